"""Values with 50 digits, from the physics alone: this package imports nothing of vibroimpact.

`python tests/oracles/values.py` computes what tests/data/values.json holds (but for its averages over chaos, which are
statistics of 4e7 impacts) and prints it beside what is stored. `motion` has flights, contacts and chatter; `cycles` has
periodic orbits by two ways that share no equation.
"""
