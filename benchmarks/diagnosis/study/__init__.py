"""Score the diagnosis on readings whose true cause is known: `python -m benchmarks.diagnosis.study FOLDER`."""
