"""Foreign worlds: generators of measurement sets that the diagnosis is tried on, each by another hand.

Rule: a world shares no code with the program, nor with another world. It imports numpy, scipy, its own library of
kinematics and the standard library; of the program it reads the robots' description files as text, no more. What it
hides is drawn before the program is run and never tuned to what the program finds.
``tests/benchmarks/test_worlds_apart.py`` holds the rule.
"""
