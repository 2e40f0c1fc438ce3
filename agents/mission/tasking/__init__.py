"""Task allocation: which UAV flies to which survivor (an auction), and how it approaches the one that it has won."""
