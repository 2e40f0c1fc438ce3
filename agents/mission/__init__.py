"""Search and rescue on board one UAV, sans-IO; the folders are layers (`pyproject.toml`, import-linter)."""
