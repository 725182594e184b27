"""Independent answers to compare the engine with: Mitsuba 3, closed forms and accurate radiosity."""
