"""What a renderer has been given to draw: fans, meshes and surfaces, and what they share on the GPU."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from impostor.errors import SettingsError
from impostor.fan import Fan
from impostor.model import Model
from impostor.shadow_projection import Ground
from runtime.checks import check_type
from runtime.fans.batch import Batch
from runtime.fans.lod import LevelOfDetail, Levels
from runtime.fans.textures import FanTextures
from runtime.gl.state import preserved_state
from runtime.instances.instances import Instances
from runtime.meshes.buffers import MeshBuffers
from runtime.meshes.bump import Bump
from runtime.meshes.copies import MeshInstance
from runtime.shadows.casters import Casting
from runtime.shadows.receiver import Receiver
from runtime.surfaces.surface_pass import Surface


class Placed:
    """Fans, meshes and surfaces of a renderer; a fan's textures and a model's buffers are there once.

    Parameters
    ----------
    ctx : moderngl.Context

    Attributes
    ----------
    batches : list of Batch
    meshes : list of MeshInstance
    surfaces : list of Surface
    """

    def __init__(self, ctx: moderngl.Context):
        self._ctx = ctx
        self.batches: list[Batch] = []
        self.meshes: list[MeshInstance] = []
        self.surfaces: list[Surface] = []
        self._stand_ins: dict[int, MeshInstance] = {}

    def add(self, instances: Instances, model: Model | None, level_of_detail: LevelOfDetail | None) -> None:
        """Take copies of a fan, and the mesh that they are near the camera."""
        fan, levels = instances.fan, None
        if model is not None:
            levels = Levels(instances, self.mesh_buffers(model), level_of_detail or LevelOfDetail())
        textures = next((batch.textures for batch in self.batches if batch.instances.fan is fan), None)
        if textures is None:
            with preserved_state(self._ctx):
                textures = FanTextures(self._ctx, fan)
        self.batches.append(Batch(instances, textures, levels))

    def add_surface(self, surface: Surface) -> None:
        """Take a surface."""
        self._stand_ins[id(surface)] = MeshInstance(self.mesh_buffers(surface.model))
        self.surfaces.append(surface)

    def remove(self, placed: object) -> list[Fan]:
        """Let go of copies, a mesh or a surface, if it is there; returns the fans that are not there any more."""
        batches = [batch for batch in self.batches if batch.instances is placed]
        meshes = [mesh for mesh in self.meshes if mesh is placed]
        if any(surface is placed for surface in self.surfaces):
            self.surfaces = [surface for surface in self.surfaces if surface is not placed]
            meshes.append(self._stand_ins.pop(id(placed)))
        self.batches = [batch for batch in self.batches if batch.instances is not placed]
        self.meshes = [mesh for mesh in self.meshes if mesh is not placed]
        gone = [batch for batch in batches if not any(each.textures is batch.textures for each in self.batches)]
        for batch in gone:
            batch.textures.release()
        used = self._buffers()
        owners = [*meshes, *(batch.levels for batch in batches if batch.levels is not None)]
        for key, buffers in {id(owner.buffers): owner.buffers for owner in owners}.items():
            if key not in used:
                buffers.release()
        return [batch.instances.fan for batch in gone]

    def holds(self, placed: object) -> bool:
        """Whether copies, a mesh or a surface is there."""
        copies = (batch.instances for batch in self.batches)
        return any(placed is each for each in (*copies, *self.meshes, *self.surfaces))

    @property
    def levels(self) -> list[Levels]:
        """Of all fans that have a mesh."""
        return [batch.levels for batch in self.batches if batch.levels is not None]

    @property
    def visible_meshes(self) -> list[MeshInstance]:
        """Those that are drawn and cast shadows."""
        return [mesh for mesh in self.meshes if mesh.visible]

    def casting(self) -> Casting:
        """All that casts shadows."""
        return Casting(self.batches, self.visible_meshes, [self._stand_in(surface) for surface in self.surfaces])

    def receiver(self, ground: Ground | Surface) -> Receiver:
        """What shadows are to fall on.

        Raises
        ------
        SettingsError
            Neither a ground nor a flat surface of this renderer.
        """
        if not isinstance(ground, Surface):
            check_type("ground", ground, Ground, " or a Surface")
            return Receiver(ground)
        if not self.holds(ground):
            raise SettingsError("ground", "a Surface that is not in this renderer; expected one that is")
        return Receiver.of(ground, self._stand_in(ground))

    def _stand_in(self, surface: Surface) -> MeshInstance:
        """The mesh that casts and receives shadows for a surface."""
        mesh = self._stand_ins[id(surface)]
        mesh.world_from_model = surface.matrix()
        return mesh

    def mesh_buffers(self, model: Model, bump: Bump | None = None) -> MeshBuffers:
        """A model's buffers, shared by everything that draws it with the same bumps."""
        for buffers in self._buffers().values():
            if buffers.model is model and buffers.bump is bump:
                return buffers
        with preserved_state(self._ctx):
            return MeshBuffers(self._ctx, model, bump)

    def _buffers(self) -> dict[int, MeshBuffers]:
        return {id(owner.buffers): owner.buffers for owner in self._owners()}

    def _owners(self) -> Iterator[MeshInstance | Levels]:
        yield from (*self.meshes, *self.levels, *self._stand_ins.values())

    def release(self) -> None:
        """Free everything on the GPU."""
        for textures in {id(batch.textures): batch.textures for batch in self.batches}.values():
            textures.release()
        for buffers in self._buffers().values():
            buffers.release()
        self.batches.clear()
        self.meshes.clear()
        self.surfaces.clear()
        self._stand_ins.clear()
