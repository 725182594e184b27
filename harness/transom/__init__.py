"""Transom: interactive daylighting of building interiors, with every picture checked against ground truth."""
