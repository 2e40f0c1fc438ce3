"""Which UAV goes to which survivor: the auction, the bids of one UAV, and its approach to the one it has won."""
