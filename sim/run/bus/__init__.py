"""The bus for a swarm's operator: router, certificates, rights, running swarms, and changes of the air."""
