"""The sans-IO core: no clock, no socket, no thread."""
