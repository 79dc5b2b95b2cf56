"""Start one stage: what the command of every rule runs, by the Python it chooses.

python -P stage.py FOLDER --job TEXT --input FILE.. --output FILE.. --log FILE
"""

import sys

# The package that planned the job stands in FOLDER; all else comes from where this Python has it.
sys.path.insert(0, sys.argv[1])
from kinacc.workflow.stage import main

sys.path.pop(0)
main(sys.argv[2:])
