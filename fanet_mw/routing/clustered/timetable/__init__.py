"""The timetable of collision-free floods: how it is computed from positions or measured links."""
