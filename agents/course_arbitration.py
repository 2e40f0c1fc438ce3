"""The choice of the course that a UAV flies, of those that its applications command.

A course is flown if no other application objects, once all have had the same input; of several courses of one
application the last counts.
"""

from collections.abc import Callable, Sequence

from fanet_mw.application import Application, Course


class CourseArbitration:
    """The courses that the applications of one UAV command, and the one that is flown."""

    def __init__(
        self,
        applications: Sequence[Application],
        judges: Sequence[Application],
        fly: Callable[[Course, int], None],
    ) -> None:
        """`applications` stand in the order in which their courses count; `judges` are those that may object."""
        self._applications = tuple(applications)
        self._judges = tuple(judges)
        self._fly = fly
        self._commanded: dict[str, Course] = {}
        """The courses that were commanded since the last input, by application."""

    def command(self, application: Application, course: Course) -> None:
        self._commanded[application.name] = course

    def settle(self, now_ns: int) -> None:
        """Fly what was commanded since the last input."""
        if not self._commanded:
            return
        commanded, self._commanded = self._commanded, {}
        for application in self._applications:
            course = commanded.get(application.name)
            if course is None:
                continue
            objections = [o for o in self._judges if o is not application and not o.permits(course, now_ns)]
            if not objections:
                self._fly(course, now_ns)
