"""A trace against the truth: what a screen-space method could have known, and error in four parts.

Everything takes a `Frame` and a `Truth` of the same camera and size; docs/blame.md.
"""

from .ambiguity import MOVE_PX as MOVE_PX
from .ambiguity import Rerun as Rerun
from .ambiguity import ambiguity as ambiguity
from .charges import Charge as Charge
from .oracle import trace_oracle as trace_oracle
from .outcome import Outcome as Outcome
from .outcome import Spread as Spread
from .outcome import outcome as outcome
from .parts import Blame as Blame
from .parts import BlameTotals as BlameTotals
from .parts import blame as blame
from .screen import TotalError as TotalError
from .screen import total_error as total_error
