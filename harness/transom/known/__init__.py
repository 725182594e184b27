"""Known answers: scenes whose light follows from a closed form or an independent high-order solution."""
