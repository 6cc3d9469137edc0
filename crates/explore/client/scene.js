// Where the parts of a model are drawn.
//
// A point mass has no position. Masses are placed from left to right as springs and joints connect
// them. A ring is a wheel: parts that springs connect to the shaft stand outside in this order, and
// parts that only joints hold, such as dampers, stand inside, between the parts that they touch.

/**
 * @typedef {{name: string, x: number, y: number, radius: number, along: [number, number], out: [number, number]}} Mass
 * @typedef {{from: string, to: string, kind: "spring" | "joint", name: string, bend: number}} Link
 * @param {any} model
 * @returns {{masses: Mass[], links: Link[], ground: Mass[], forces: {on: string, direction: string, phase: number, harmonic: number}[], wheel: boolean}}
 */
export function sceneOf(model) {
  const wheel = Boolean(model.ring);
  const lists = [model.masses, model.bodies ?? [], model.places.filter((/** @type {any} */ one) => !one.of)].map((list) => list.map((/** @type {any} */ one) => one.name));
  const names = wheel ? bySector(lists, model.ring.sectors) : lists.flat();
  const owner = (/** @type {string} */ place) => names.find((name) => place === name || place.startsWith(`${name}.`)) ?? viewOf(model, place) ?? place;
  const moved = [...new Set(model.motions.map((/** @type {any} */ one) => owner(one.on)))].filter((name) => !names.includes(name));
  const all = [...names, ...moved];
  const pairs = [...model.springs.map((/** @type {any} */ one) => ({ between: one.between.map(owner), kind: "spring", name: "" })), ...model.joints.map((/** @type {any} */ one) => ({ between: one.between.map(owner), kind: "joint", name: one.name }))];
  const weight = (/** @type {string} */ name) => model.masses.find((/** @type {any} */ one) => one.name === name)?.mass ?? 0;
  const most = Math.max(1e-12, ...model.masses.map((/** @type {any} */ one) => one.mass));
  const radius = (/** @type {string} */ name) => Math.max(wheel ? 0.35 : 0.45, Math.cbrt(weight(name) / most)) * (wheel ? 0.8 : 1);
  const masses = wheel ? onWheel(all, model.ring.sectors, pairs) : inRows(all, pairs);
  const ground = /** @type {Mass[]} */ ([]);
  const links = pairs.map(({ between, kind, name }) => {
    const ends = between.map((/** @type {string} */ end, /** @type {number} */ which) => {
      if (end !== "ground") { return end; }
      const other = masses.get(between[1 - which]) ?? { x: 0, y: 0, along: [1, 0] };
      const id = `ground ${between[1 - which]}`;
      if (!ground.some((one) => one.name === id)) {
        const place = wheel ? { x: other.x * 0.72, y: other.y * 0.72 } : { x: other.x, y: other.y + 1.15 };
        ground.push({ name: id, radius: 0.3, along: [1, 0], out: [0, -1], ...place });
      }
      return id;
    });
    return { from: ends[0], to: ends[1], kind, name, bend: 0 };
  });
  /** @type {Map<string, number>} */
  const count = new Map();
  for (const link of links) {
    const key = [link.from, link.to].sort().join("|");
    const seen = count.get(key) ?? 0;
    count.set(key, seen + 1);
    link.bend = seen === 0 ? 0 : (seen % 2 ? 1 : -1) * Math.ceil(seen / 2);
  }
  const list = all.map((name) => ({ name, radius: radius(name), ...masses.get(name) }));
  // a constant force does not move anything during a period
  const moving = model.forces.filter((/** @type {any} */ one) => one.harmonic > 0);
  const forces = moving.map((/** @type {any} */ one) => ({ on: owner(one.on), direction: one.on.slice(owner(one.on).length + 1), phase: one.phase, harmonic: one.harmonic }));
  return /** @type {any} */ ({ masses: list, links, ground, forces, wheel });
}

/** The names of lists, each of them sector by sector, as one list sector by sector. @param {string[][]} lists @param {number} sectors */
function bySector(lists, sectors) {
  const part = (/** @type {string[]} */ list, /** @type {number} */ sector) => list.slice(sector * list.length / sectors, (sector + 1) * list.length / sectors);
  return Array.from({ length: sectors }, (_, sector) => lists.flatMap((list) => part(list, sector))).flat();
}

/** The mass of which a place is a view. @param {any} model @param {string} place */
const viewOf = (model, place) => model.places.find((/** @type {any} */ one) => place === one.name || place.startsWith(`${one.name}.`))?.of;

/** @param {string[]} names @param {number} sectors @param {any[]} pairs */
function onWheel(names, sectors, pairs) {
  const each = Math.max(1, Math.round(names.length / sectors));
  const levels = names.slice(0, each).map((name) => ({ name, level: springsToGround(name, pairs) }));
  const order = [...new Set(levels.map((one) => one.level))].sort((a, b) => a - b);
  // a part without springs, such as a damper, stands halfway to the neighbour that it touches
  const touches = (/** @type {string} */ name, /** @type {number} */ sector) => pairs.some(({ between }) => between.includes(name) && between.some((/** @type {string} */ end) => names.indexOf(end) >= sector * each && names.indexOf(end) < (sector + 1) * each));
  const shifts = levels.map(({ name, level }) => (level > 0 || sectors < 3 ? 0 : touches(name, 1) ? 0.5 : touches(name, sectors - 1) ? -0.5 : 0));
  return new Map(names.map((name, index) => {
    const sector = Math.floor(index / each);
    const ring = order.indexOf(levels[index % each].level);
    const angle = 2 * Math.PI * (sector + shifts[index % each]) / sectors - Math.PI / 2;
    const distance = sectors * 0.42 * (1 - 0.3 * (order.length - 1 - ring) / Math.max(2, order.length)) + 0.8;
    const [x, y] = [Math.cos(angle), Math.sin(angle)];
    return [name, { x: distance * x, y: distance * y, along: [-y, x], out: [x, y] }];
  }));
}

/** Number of springs from a mass to the ground; zero if no springs lead there. @param {string} name @param {any[]} pairs */
function springsToGround(name, pairs) {
  const springs = pairs.filter((one) => one.kind === "spring");
  const seen = new Set([name]);
  let front = [name];
  for (let count = 1; front.length > 0; count += 1) {
    const next = springs.filter(({ between }) => between.some((/** @type {string} */ end) => front.includes(end))).flatMap(({ between }) => between);
    if (next.includes("ground")) { return count; }
    front = [...new Set(next)].filter((end) => !seen.has(end));
    front.forEach((end) => seen.add(end));
  }
  return 0;
}

/** Puts masses of equal distance from the first one into one column. @param {string[]} names @param {any[]} pairs */
function inRows(names, pairs) {
  const places = new Map();
  let row = 0;
  const open = new Set(names);
  while (open.size > 0) {
    // a chain begins at a mass with one neighbour
    const degree = (/** @type {string} */ name) => new Set(pairs.filter(({ between }) => between.includes(name)).flatMap(({ between }) => between).filter((other) => other !== name && open.has(other))).size;
    const first = [...open].sort((a, b) => degree(a) - degree(b) || names.indexOf(a) - names.indexOf(b))[0];
    let column = [first];
    let x = 0;
    let tallest = 1;
    while (column.length > 0) {
      column.forEach((name, i) => { places.set(name, { x: 2.6 * x, y: row + 1.6 * (i - (column.length - 1) / 2), along: [1, 0], out: [0, -1] }); open.delete(name); });
      tallest = Math.max(tallest, column.length);
      const next = new Set(pairs.filter(({ between }) => between.some((/** @type {string} */ end) => column.includes(end))).flatMap(({ between }) => between).filter((end) => open.has(end)));
      column = [...next];
      x += 1;
    }
    row += 1.6 * tallest + 1.6;
  }
  return places;
}
