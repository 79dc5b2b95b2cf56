"""Run the commands with ``python -m kinacc`` where scripts are not on the path."""

from kinacc.cli.group import main

if __name__ == "__main__":
    main()
