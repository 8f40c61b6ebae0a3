// The twin of facewright/expand.py: pose weights to the weights of all targets.
// inBetweens: shape -> {weight: target}; correctives: target -> [drivers]; halves: sum -> [left, right];
// names: all targets of the rig, for an Error where a pose names another shape.
export function expandWeights(poseWeights, inBetweens, correctives, halves = {}, names = null) {
  for (const name of names ? Object.keys(poseWeights) : []) {
    if (!names.includes(name) && !Object.hasOwn(halves, name)) throw new Error(`the rig has no shape '${name}'`);
  }
  const pose = { ...poseWeights };
  for (const [name, parts] of Object.entries(halves)) {
    const weight = pose[name] ?? 0;
    delete pose[name];
    if (weight !== 0) for (const part of parts) pose[part] = (pose[part] ?? 0) + weight;
  }
  const drive = { ...pose };
  for (const [name, parts] of Object.entries(halves)) {
    drive[name] = parts.reduce((sum, part) => sum + (pose[part] ?? 0), 0) / parts.length;
  }
  const result = {};
  const add = (name, weight) => {
    if (weight !== 0) result[name] = (result[name] ?? 0) + weight;
  };
  for (const [name, weight] of Object.entries(pose)) {
    const steps = Object.entries(inBetweens[name] ?? {}).map(([at, target]) => [Number(at), target]);
    const stops = [[0, null], ...steps.sort((a, b) => a[0] - b[0]), [1, name]];
    let piece = 1;
    while (piece < stops.length - 1 && weight > stops[piece][0]) piece += 1;
    const [low, high] = [stops[piece - 1], stops[piece]];
    const share = (weight - low[0]) / (high[0] - low[0]);
    if (low[1] !== null) add(low[1], 1 - share);
    add(high[1], share);
  }
  for (const [target, drivers] of Object.entries(correctives)) {
    add(target, drivers.reduce((product, driver) => product * Math.min(Math.max(drive[driver] ?? 0, 0), 1), 1));
  }
  return result;
}
