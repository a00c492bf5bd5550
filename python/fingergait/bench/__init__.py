"""`fingergait bench`: how long the control step and its solvers take, beside other solvers, and how exact they are."""
