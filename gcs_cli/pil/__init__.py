"""The same mission with the loops in Python, in C and on a target: flown, compared, judged and reported."""
