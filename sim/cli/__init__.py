"""The `fanet` command and its subcommands."""
