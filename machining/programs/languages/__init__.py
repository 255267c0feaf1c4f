"""The languages of programs, one a file: each module here has its ``FORMAT`` (:mod:`machining.programs.format`)."""
