"""Kinematics and stiffness on request: JSON lines for a postprocessor that asks at every toolpath point."""

from machining.service.session import PROTOCOL, Session, serve
from machining.service.state import State

__all__ = ["PROTOCOL", "Session", "State", "serve"]
