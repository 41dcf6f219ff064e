"""The commands of `./boom`, one module each: `HELP`, `add_arguments(parser)`, `run(args) -> int`."""
