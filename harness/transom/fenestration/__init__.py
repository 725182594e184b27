"""Glazing products in openings: what they make of sun and sky, the same for every renderer."""
