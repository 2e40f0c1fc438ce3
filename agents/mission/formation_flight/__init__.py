"""Formation flight by clusters: the members of a cluster fly around its head, the heads around the leader."""
