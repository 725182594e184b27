"""The subcommands of `transom`, one module each for pictures, sensors, suites, verdicts and lists."""
