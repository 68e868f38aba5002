// Fills gaps in the motion of a character with small.onnx: in a browser, in Node, wherever onnxruntime-web runs.
//
// All is right-handed with Y up, as in three.js; quaternions are [w, x, y, z], places [x, y, z] in metres, and
// there are 30 frames a second. docs/networks.md says what the graph takes and gives.

const multiply = ([a, b, c, d], [e, f, g, h]) => [
  a * e - b * f - c * g - d * h,
  a * f + b * e + c * h - d * g,
  a * g - b * h + c * e + d * f,
  a * h + b * g - c * f + d * e,
];
const conjugate = ([w, x, y, z]) => [w, -x, -y, -z];

/** A rig as the network sees it, from what `interpose skeleton rig.bvh --json` prints of it. */
export class Rig {
  constructor(told) {
    this.names = Object.keys(told.mapping); // the 22 canonical joints
    this.joints = Object.values(told.mapping); // the rig's own, null where it has none
    this.parents = this.names.map(name => this.names.indexOf(told.parents[name]));
    this.tPose = this.joints.map(joint => told.t_pose[joint]);
    this.bones = this.names.map(name => told.bones[name].map(x => x * told.scale));
    this.scale = told.scale;
  }

  /** Canonical rotations relative to the parent's, from how joints are turned in the world ({joint: quaternion}). */
  local(turned) {
    const canonical = [];
    this.joints.forEach((joint, row) => {
      canonical.push(
        joint === null ? canonical[this.parents[row]] : multiply(turned[joint], conjugate(this.tPose[row])),
      );
    });
    return canonical.map((own, row) => (row ? multiply(conjugate(canonical[this.parents[row]]), own) : own));
  }

  /** The way back: how joints are turned in the world. */
  turned(local) {
    const canonical = [];
    local.forEach((own, row) => canonical.push(row ? multiply(canonical[this.parents[row]], own) : own));
    const own = canonical.map((turn, row) => [this.joints[row], this.tPose[row] && multiply(turn, this.tPose[row])]);
    return Object.fromEntries(own.filter(([joint]) => joint !== null));
  }
}

/**
 * Frames start to stop - 1 of a motion, made up.
 *
 * @param ort onnxruntime-web, and a session of it with small.onnx.
 * @param rig a Rig.
 * @param frames {turned: {joint: quaternion}, hips: place} each: ten on either side of the gap are enough. What
 *   the frames of the gap hold does not matter; they may be null.
 * @param label the number of an action in "labels" of small.json; 0 leaves it open.
 * @returns for each frame of the gap {turned, hips, contact: how likely left ankle and toe, right ankle and toe
 *   stand, error: the metres that joints are expected to be off}.
 */
export async function fill(ort, session, rig, frames, start, stop, label = 0) {
  const count = rig.names.length;
  const known = frames.map((_, frame) => frame < start || frame >= stop);
  const first = frames[known.indexOf(true)].hips;
  const origin = [first[0], 0, first[2]]; // 32-bit numbers are precise near it
  const still = [1, 0, 0, 0];
  const local = frames.map((one, frame) => (known[frame] ? rig.local(one.turned) : Array(count).fill(still)));
  const root = frames.map((one, frame) =>
    known[frame] ? one.hips.map((x, axis) => (x - origin[axis]) * rig.scale) : [0, 0, 0],
  );
  // Joints that the rig does not have are known to turn with their parents; last, where the hips are.
  const held = known.map(all => [...rig.joints.map(joint => +(all || joint === null)), +all]);
  const float = (values, ...dims) => new ort.Tensor("float32", Float32Array.from(values.flat(3)), dims);
  const said = await session.run({
    local: float(local, 1, frames.length, count, 4),
    root: float(root, 1, frames.length, 3),
    known: float(held, 1, frames.length, count + 1),
    pinned: float(Array(frames.length * count * 3).fill(0), 1, frames.length, count, 3),
    pins: new ort.Tensor("bool", new Uint8Array(frames.length * count), [1, frames.length, count]),
    label: new ort.Tensor("int64", BigInt64Array.from([BigInt(label)]), [1]),
    bones: float(rig.bones, 1, count, 3),
  });
  const at = (name, frame, size) => [...said[name].data.slice(frame * size, (frame + 1) * size)];
  return Array.from({ length: stop - start }, (_, i) => {
    const turns = at("local_out", start + i, count * 4);
    return {
      turned: rig.turned(rig.names.map((_, row) => turns.slice(4 * row, 4 * row + 4))),
      hips: at("root_out", start + i, 3).map((x, axis) => x / rig.scale + origin[axis]),
      contact: at("contact", start + i, 4),
      error: at("error", start + i, 1)[0] / 100 / rig.scale,
    };
  });
}
