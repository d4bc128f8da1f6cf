"""Materials as expressions: `Value` is a number, a vector or a color that differs from point to point of a surface."""

import bpy


def color(text):
    """`#rrggbb`, as screens show it, as the linear color that shaders compute with."""
    bytes_of = [int(text.lstrip("#")[index:index + 2], 16) / 255 for index in (0, 2, 4)]
    return tuple(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in bytes_of)


class Value:
    """What a node of a shader gives. Arithmetic with numbers and other values makes further nodes."""

    def __init__(self, paint, socket):
        self.paint, self.socket = paint, socket

    def _with(self, operation, *others):
        kind = "ShaderNodeVectorMath" if self.socket.type in ("VECTOR", "RGBA") else "ShaderNodeMath"
        node = self.paint.node(kind, operation=operation)
        for socket, value in zip(node.inputs, (self, *others)):
            if kind == "ShaderNodeVectorMath" and isinstance(value, (int, float)):
                value = (value, value, value)
            self.paint.set(socket, value)
        return Value(self.paint, node.outputs[0])

    def __add__(self, other):
        return self._with("ADD", other)

    def __sub__(self, other):
        return self._with("SUBTRACT", other)

    def __rsub__(self, other):
        return self.paint.constant(other)._with("SUBTRACT", self)

    def __mul__(self, other):
        return self._with("MULTIPLY", other)

    def __truediv__(self, other):
        return self._with("DIVIDE", other)

    def __mod__(self, other):
        return self._with("MODULO", other)

    __radd__, __rmul__ = __add__, __mul__

    def __abs__(self):
        return self._with("ABSOLUTE")

    def fraction(self):
        """What stands behind the point."""
        return self._with("FRACT")

    def floor(self):
        """The whole number below."""
        return self._with("FLOOR")

    def root(self):
        """The square root."""
        return self._with("SQRT")

    def sine(self):
        """Of radians."""
        return self._with("SINE")

    def cosine(self):
        """Of radians."""
        return self._with("COSINE")

    def arcsine(self):
        """In radians."""
        return self._with("ARCSINE")

    def angle(self, x):
        """The direction of the point (x, self), in radians from -π to π."""
        return self._with("ARCTAN2", x)

    def larger(self, other):
        """The larger of two."""
        return self._with("MAXIMUM", other)

    def above(self, edge, width=0.002):
        """0 below `edge`, 1 above it, and between over `width` to both sides."""
        node = self.paint.node("ShaderNodeMapRange", clamp=True)
        self.paint.set(node.inputs["Value"], self)
        node.inputs["From Min"].default_value = edge - width
        node.inputs["From Max"].default_value = edge + width
        return Value(self.paint, node.outputs["Result"])

    def below(self, edge, width=0.002):
        """1 below `edge`, 0 above it."""
        return 1.0 - self.above(edge, width)

    def between(self, low, high, width=0.002):
        """1 from `low` to `high`, 0 elsewhere."""
        return self.above(low, width) * self.below(high, width)

    def parts(self):
        """The three numbers of a vector."""
        node = self.paint.node("ShaderNodeSeparateXYZ")
        self.paint.set(node.inputs[0], self)
        return tuple(Value(self.paint, output) for output in node.outputs)

    def ramp(self, stops, steps=False):
        """A color by this number: `stops` are (number, color). `steps`: no color between them."""
        node = self.paint.node("ShaderNodeValToRGB")
        ramp = node.color_ramp
        ramp.interpolation = "CONSTANT" if steps else "LINEAR"
        while len(ramp.elements) < len(stops):
            ramp.elements.new(0.5)
        for element, (position, shade) in zip(ramp.elements, stops):
            element.position, element.color = position, (*shade, 1)
        self.paint.set(node.inputs[0], self)
        return Value(self.paint, node.outputs["Color"])


class Paint:
    """A material that is being made. `surface` or `glow` finishes it."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.output = self.tree.nodes.new("ShaderNodeOutputMaterial")

    def node(self, kind, **properties):
        """A node with properties by name."""
        made = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(made, name, value)
        return made

    def set(self, socket, value):
        """Connects a value, or sets a number, a vector or a color."""
        if isinstance(value, Value):
            self.tree.links.new(value.socket, socket)
        elif socket.type == "RGBA" and len(value) == 3:
            socket.default_value = (*value, 1)
        else:
            socket.default_value = value

    def constant(self, number):
        """A number as a value."""
        node = self.node("ShaderNodeValue")
        node.outputs[0].default_value = number
        return Value(self, node.outputs[0])

    def at(self, attribute="rest"):
        """Where on its mesh a point lies: a vector that the mesh keeps for each vertex."""
        return Value(self, self.node("ShaderNodeAttribute", attribute_name=attribute).outputs["Vector"])

    def vector(self, x, y, z):
        """Three numbers as a vector."""
        node = self.node("ShaderNodeCombineXYZ")
        for socket, value in zip(node.inputs, (x, y, z)):
            self.set(socket, value)
        return Value(self, node.outputs[0])

    def noise(self, at, scale=5.0, detail=4.0, roughness=0.5, distortion=0.0, three=False):
        """Clouds, from 0 to 1, around 0.5. `three`: three such numbers, which differ, as a color."""
        node = self.node("ShaderNodeTexNoise")
        self.set(node.inputs["Vector"], at)
        for name, value in (("Scale", scale), ("Detail", detail), ("Roughness", roughness), ("Distortion", distortion)):
            node.inputs[name].default_value = value
        return Value(self, node.outputs["Color" if three else 0])

    def cells(self, at, scale=5.0, edges=False, randomness=1.0):
        """The distance from the middle of the nearest cell; with `edges`, from the border between two."""
        node = self.node("ShaderNodeTexVoronoi", feature="DISTANCE_TO_EDGE" if edges else "F1")
        self.set(node.inputs["Vector"], at)
        node.inputs["Scale"].default_value = scale
        node.inputs["Randomness"].default_value = randomness
        return Value(self, node.outputs["Distance"])

    def cell_colors(self, at, scale=5.0):
        """A color for each cell, drawn at random."""
        node = self.node("ShaderNodeTexVoronoi", feature="F1")
        self.set(node.inputs["Vector"], at)
        node.inputs["Scale"].default_value = scale
        return Value(self, node.outputs["Color"])

    def bands(self, at, scale=5.0, distortion=0.0, detail=2.0, direction="X", detail_scale=1.0):
        """Waves across a direction, as in wood."""
        node = self.node("ShaderNodeTexWave", wave_type="BANDS", bands_direction=direction)
        self.set(node.inputs["Vector"], at)
        for name, value in (("Scale", scale), ("Distortion", distortion), ("Detail", detail), ("Detail Scale", detail_scale)):
            node.inputs[name].default_value = value
        return Value(self, node.outputs["Fac"])

    def checks(self, at, scale, first, second):
        """Two colors by turns, in cubes."""
        node = self.node("ShaderNodeTexChecker")
        for name, value in (("Vector", at), ("Color1", first), ("Color2", second)):
            self.set(node.inputs[name], value)
        node.inputs["Scale"].default_value = scale
        return Value(self, node.outputs["Color"])

    def bricks(self, at, scale, first, second, mortar):
        """Bricks of two colors."""
        node = self.node("ShaderNodeTexBrick")
        for name, value in (("Vector", at), ("Color1", first), ("Color2", second), ("Mortar", mortar)):
            self.set(node.inputs[name], value)
        node.inputs["Scale"].default_value = scale
        node.inputs["Mortar Size"].default_value = 0.03
        return Value(self, node.outputs["Color"])

    def mix(self, share, first, second):
        """`first` where `share` is 0, `second` where it is 1."""
        node = self.node("ShaderNodeMix", data_type="RGBA", blend_type="MIX")
        self.set(node.inputs["Factor"], share)
        for socket, value in zip((socket for socket in node.inputs if socket.type == "RGBA"), (first, second)):
            self.set(socket, value)
        return Value(self, next(socket for socket in node.outputs if socket.type == "RGBA"))

    def bump(self, height, strength=0.3, distance=0.02):
        """Normals of a surface that rises by `height`."""
        node = self.node("ShaderNodeBump")
        node.inputs["Strength"].default_value = strength
        node.inputs["Distance"].default_value = distance
        self.set(node.inputs["Height"], height)
        return Value(self, node.outputs[0])

    def backside(self):
        """1 where a face is seen from behind."""
        return Value(self, self.node("ShaderNodeNewGeometry").outputs["Backfacing"])

    def surface(self, base, roughness=0.5, metal=0.0, normal=None, coat=0.0, sheen=0.0, glow=None, see_through=0.0):
        """The finished material. `glow`: a color that it shines in by itself. `see_through`: the share of light that passes."""
        node = self.node("ShaderNodeBsdfPrincipled")
        self.set(node.inputs["Base Color"], base)
        self.set(node.inputs["Roughness"], roughness)
        self.set(node.inputs["Metallic"], metal)
        if normal is not None:
            self.set(node.inputs["Normal"], normal)
        self.set(node.inputs["Coat Weight"], coat)
        node.inputs["Coat Roughness"].default_value = 0.1
        self.set(node.inputs["Sheen Weight"], sheen)
        if glow is not None:
            self.set(node.inputs["Emission Color"], glow)
            node.inputs["Emission Strength"].default_value = 1.0
        if isinstance(see_through, Value) or see_through > 0.0:
            self.set(node.inputs["Alpha"], 1.0 - see_through)
        self.tree.links.new(node.outputs[0], self.output.inputs[0])
        return self.material


def plain(name, base, roughness=0.5, metal=0.0, coat=0.0):
    """One color everywhere."""
    return Paint(name).surface(color(base), roughness, metal, coat=coat)


def clouded(name, dark, light, scale, roughness=0.4, metal=0.0, coat=0.0, distortion=0.5):
    """From one color to another in clouds: stone, wood, worn metal."""
    paint = Paint(name)
    shade = paint.noise(paint.at(), scale, 5, 0.6, distortion)
    return paint.surface(shade.ramp([(0.3, color(dark)), (0.7, color(light))]), roughness, metal, coat=coat)


def glow_only(name, brightness):
    """The same gray from everywhere, in any light: for masks."""
    paint = Paint(name)
    node = paint.node("ShaderNodeEmission")
    node.inputs["Color"].default_value = (brightness, brightness, brightness, 1)
    paint.tree.links.new(node.outputs[0], paint.output.inputs[0])
    return paint.material
