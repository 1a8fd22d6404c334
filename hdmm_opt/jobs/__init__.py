"""Design: gains, proofs, validation, and what is made of many of them."""
