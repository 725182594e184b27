"""Hard cases: rooms, suns and cameras at the limits of the numbers, each with claims that must hold."""
