"""The tables of a scenario file, each in the file of its name: `[radio]` in `radio.py`. Each table checks itself."""
