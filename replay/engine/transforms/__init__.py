"""Log transforms: what if there had been no fixes, fewer satellites, a slower or noisier sensor.

A transform writes a new log whose manifest says what was done, in words that do it again;
rows that are left alone keep their bytes.
"""

from replay.engine.transforms.outages import DEGRADE, Outage, plan_outages
from replay.engine.transforms.settings import Method, Transform
from replay.engine.transforms.write import TRANSFORM, Transformed, transform_log

__all__ = [
    "DEGRADE",
    "TRANSFORM",
    "Method",
    "Outage",
    "Transform",
    "Transformed",
    "plan_outages",
    "transform_log",
]
