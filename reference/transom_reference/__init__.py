"""Independent answers to compare the engine with: Mitsuba 3, Radiance, closed forms and accurate radiosity."""
