"""What is missing by positions of targets: options, answer, words, page."""
