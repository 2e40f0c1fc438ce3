"""The bus of running swarms: certificates, rights, who runs, and an operator's changes of the air and orders."""
