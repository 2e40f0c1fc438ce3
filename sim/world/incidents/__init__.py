"""What should not happen in flight and is counted: UAVs too near to each other, UAVs where nobody may fly."""
