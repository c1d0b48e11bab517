"""The table robot with a second camera: the integrator chooses the one for the recognition, also during a run."""

from collections.abc import Iterable
from dataclasses import replace

from domains.clean_up_table.bringup import TableSimulation, bundle
from domains.clean_up_table.components import Camera
from domains.clean_up_table.outcomes import NothingFound, NotPossible, Recognised, Surface
from dsc import ALWAYS, Component, Push, SkillCall, Stream, skill
from planning import Bundle, deploy


class Lens(Component):
    """A camera as its vendor sells it, who knows no recognition; it takes five pictures in a second."""

    period = 0.2
    picture = Push({"number": "number"})
    taken = 0

    async def step(self) -> None:
        self.taken += 1
        self.picture.put(number=self.taken)


class Recognition(Camera):
    """The recognition of the table robot, which needs the pictures of any camera."""

    needs = {ALWAYS: ("eye",)}
    eye = Stream({"number": "number"})

    @skill(after_crash="same_id")
    async def recognise(self, call: SkillCall, surface: Surface) -> Recognised | NothingFound | NotPossible:
        await self.eye.next(within=5)
        return await super().recognise(call, surface)


class TableWithCameras(TableSimulation):
    def components(self) -> Iterable[Component]:
        others = [one for one in super().components() if one.name != Camera.name]
        return [*others, Recognition(self.world), Lens("head"), Lens("wrist")]


robot: Bundle = replace(
    bundle(),
    name="two-cameras",
    simulation=TableWithCameras,
    robots={},
    wiring={"camera.eye": "head.picture"},  # without it, two cameras fit, and the robot is refused
)


def main() -> None:
    for rewired in (False, True):
        with deploy(robot) as table:
            report = table.run(
                "clean_up_table",
                prepare=lambda run, rewired=rewired: run.wire("camera.eye", "wrist", after=20.0) if rewired else None,
            )
            used = [one.name for one in table.components if isinstance(one, Lens) and one.taken]
        print(f"goal reached: {report.reached}; pictures of {' and '.join(used)}")


if __name__ == "__main__":
    main()

# Expected output:
# goal reached: True; pictures of head
# goal reached: True; pictures of head and wrist
