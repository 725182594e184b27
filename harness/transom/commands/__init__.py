"""The subcommands of `transom`, by group: pictures, sensors, suites, verdicts, checks, speed, products."""
