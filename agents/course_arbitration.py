"""Chooses the course that a UAV flies among those that its applications command.

The last command of each application counts. A course is flown if no other application objects; they are asked after all
of them have received the same input. Nobody may object to a course that avoids a collision.
"""

from collections.abc import Callable, Sequence

from fanet_mw.application import Application, Course


class CourseArbitration:
    """The commanded courses of one UAV, and the choice among them."""

    def __init__(
        self,
        applications: Sequence[Application],
        judges: Sequence[Application],
        fly: Callable[[Course, int], None],
    ) -> None:
        """`applications`, in the order in which their courses count. `judges`: the applications that may object."""
        self._applications = tuple(applications)
        self._judges = tuple(judges)
        self._fly = fly
        self._commanded: dict[str, Course] = {}

    def command(self, application: Application, course: Course) -> None:
        self._commanded[application.name] = course

    def settle(self, now_ns: int) -> None:
        """Fly the course that was commanded since the last input and to which no application objects."""
        if not self._commanded:
            return
        commanded, self._commanded = self._commanded, {}
        for application in self._applications:
            course = commanded.get(application.name)
            if course is None:
                continue
            judges = () if application.avoids else self._judges
            objections = [o for o in judges if o is not application and not o.permits(course, now_ns)]
            if not objections:
                self._fly(course, now_ns)
