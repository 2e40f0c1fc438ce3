"""What should not happen in flight and is counted: UAVs that come too near to each other, UAVs in no-fly areas."""
