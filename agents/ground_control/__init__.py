"""What a UAV answers to a ground station: MAVLink's services of a vehicle, and the flight that an operator commands."""
