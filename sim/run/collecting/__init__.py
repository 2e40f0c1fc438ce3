"""What a run in real time collects from the bus: checked where it arrives, kept on disk, read again at the end."""
