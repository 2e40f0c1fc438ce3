"""The clustered flooding protocol of the paper, and the variants that extend it (`routing.protocol = "clustered"`)."""
