"""Run the commands with ``python -m kinacc`` where scripts are not on the path."""

from kinacc.cli.process import main

if __name__ == "__main__":
    main()
