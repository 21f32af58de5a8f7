from .engine import evaluate as evaluate
from .plan import Plan as Plan
from .results import Results as Results
