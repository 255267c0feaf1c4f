"""What every command does first and last: inputs, options, messages, output folders."""
