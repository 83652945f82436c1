from .main import cli as cli
from .main import run_command as run_command
from .main import run_process as run_process
