"""Re-prove a gain file from the file alone: `python checker.py gains.json`.

A second program. It imports nothing but Python's standard library and trusts no number that the producer derived: from
the assumptions, the gains and the model in the file it encloses the closed loop in rational interval arithmetic with
outward rounding, builds every inequality itself, and decides each exactly. What it takes as given is the statement: the
plant and the law as operation lists, the assumptions, the study.

Exit status: 0 everything proved, 1 something is not, 2 a file that cannot be read.

Assembled from the parts in stability/checking, in this order:
"""
