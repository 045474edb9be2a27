// The hallway from above: floor, walls, people, robot, scan and waypoint.

import { Brush } from "./brush.js";

const NAMES = [
  "floor", "wall", "grid", "goal", "goalLine", "start", "person", "personNose", "robot", "nose", "trail",
  "seen", "scan", "chosen", "text", "teaches", "layer", "arrow",
];
let COLOURS = colours();

// The custom properties --view-NAME of the style sheet, light or dark.
function colours() {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--view-${name}`).trim()]));
}

// Cells that are smaller have no numbers.
const LABELLED_PX = 20;
const TRAIL_STEP_M = 0.08;

export class View extends Brush {
  constructor(canvas) {
    super(canvas);
    this.trail = [];
    new ResizeObserver(() => this.fit()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      COLOURS = colours();
      this.draw();
    });
  }

  setScene(scene) {
    this.scene = scene;
    this.cells = new Map(scene.cells_m.map((cell) => [this.cellKey(cell), cell]));
    this.trail = [];
    this.fit();
  }

  // A layer of the learned model, null for none.
  setLayer(layer) {
    this.layer = layer;
    this.draw();
  }

  clearTrail() { this.trail = []; }

  fit() {
    if (!this.scene || !this.canvas.clientWidth) return;
    this.fitTo(this.scene.bounds_m);
    this.draw();
  }

  update(state) {
    this.state = state;
    if (state.world?.scan_m) this.scan = { ranges: state.world.scan_m, pose: state.world.robot };
    this.follow(state.world);
  }

  follow(world) {
    if (!world) return;
    const [x, y] = world.robot;
    const last = this.trail.at(-1);
    const step = last ? Math.hypot(x - last[0], y - last[1]) : Infinity;
    if (last && step > 1) this.trail = [];
    if (step > TRAIL_STEP_M) this.trail.push([x, y]);
  }

  draw() {
    if (!this.scene || !this.scale) return;
    this.clear();
    this.drawFloor();
    if (this.layer) this.drawLayer(this.layer);
    this.drawWalls();
    if (this.state?.world) this.drawWorld(this.state);
  }

  drawFloor() {
    const { context, scene } = this;
    this.path(scene.walls_m[0]);
    context.fillStyle = COLOURS.floor;
    context.fill();
    this.area(scene.start_m, COLOURS.start);
    this.area(scene.goal_m, COLOURS.goal, COLOURS.goalLine);
    context.strokeStyle = COLOURS.grid;
    context.lineWidth = 1;
    for (const cell of scene.cells_m) context.strokeRect(...this.square(cell, scene.cell_size_m));
    this.label("goal", centre(scene.goal_m), COLOURS.text);
  }

  drawLayer({ shades, labels, directions }) {
    this.scene.cells_m.forEach((cell, index) => {
      if (directions) this.drawArrow(cell, directions[index]);
      else this.drawValue(cell, shades[index], labels[index]);
    });
  }

  drawValue(cell, shade, label) {
    const { context, scene } = this;
    if (shade !== null) {
      context.fillStyle = `rgb(${COLOURS.layer} / ${0.04 + 0.6 * shade})`;
      context.fillRect(...this.square(cell, scene.cell_size_m));
    }
    const side = this.scale * scene.cell_size_m;
    if (shade !== null && side < LABELLED_PX) return;
    context.fillStyle = COLOURS.arrow;
    context.font = `${Math.min(11, 0.9 * side)}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(label, ...this.at(cell));
  }

  drawArrow([x, y], [east, north]) {
    const { context } = this;
    const half = 0.3 * this.scene.cell_size_m;
    if (!east && !north) {
      this.disc([x, y], 0.25 * half, COLOURS.arrow);
      return;
    }
    // Along the arrow and to its side, in shares of its half length.
    const place = (along, side) => this.at([x + half * (along * east - side * north), y + half * (along * north + side * east)]);
    context.beginPath();
    context.moveTo(...place(-1, 0));
    context.lineTo(...place(1, 0));
    context.moveTo(...place(0.35, 0.5));
    context.lineTo(...place(1, 0));
    context.lineTo(...place(0.35, -0.5));
    context.strokeStyle = COLOURS.arrow;
    context.lineWidth = Math.min(2, Math.max(1, 0.05 * this.scale));
    context.lineJoin = context.lineCap = "round";
    context.stroke();
  }

  drawWorld(state) {
    const { world } = state;
    this.drawScan();
    this.drawWaypoint(state);
    this.drawNextStart(state);
    this.drawTrail();
    for (const person of world.people) this.drawPerson(person);
    this.drawRobot(world.robot);
  }

  drawScan() {
    if (!this.scan) return;
    const { context, scene } = this;
    const [x, y, yaw] = this.scan.pose;
    const hits = this.scan.ranges.flatMap((range, index) => {
      const angle = yaw + scene.scan_start_rad + index * scene.scan_step_rad;
      return range > 0 ? [[x + range * Math.cos(angle), y + range * Math.sin(angle)]] : [];
    });
    if (!hits.length) return;
    this.path(hits);
    context.fillStyle = COLOURS.seen;
    context.fill();
    this.discs(hits, Math.min(0.04, 2 / this.scale), COLOURS.scan);
  }

  // Where the robot drives to: the waypoint, and its cell, filled.
  drawWaypoint({ waypoint }) {
    if (!waypoint) return;
    const { context } = this;
    const cell = this.cells.get(this.cellKey(waypoint));
    context.fillStyle = COLOURS.chosen;
    if (cell) context.fillRect(...this.square(cell, this.scene.cell_size_m));
    this.ring(waypoint, 0.17, COLOURS.robot, 3);
  }

  drawNextStart({ next_start: place, episode }) {
    if (!place || episode.phase === "running") return;
    this.ring(place, 0.36, COLOURS.teaches, 3);
    this.disc(place, 0.13, COLOURS.teaches);
  }

  drawTrail() {
    if (this.trail.length < 2) return;
    const { context } = this;
    context.beginPath();
    for (const point of this.trail) context.lineTo(...this.at(point));
    context.strokeStyle = COLOURS.trail;
    context.lineWidth = Math.min(6, Math.max(2, 0.09 * this.scale));
    context.lineJoin = context.lineCap = "round";
    context.stroke();
  }

  drawPerson([x, y, vx, vy]) {
    const radius = this.scene.person_radius_m;
    const speed = Math.hypot(vx, vy);
    this.disc([x, y], radius, COLOURS.person);
    if (speed < 0.05) return;
    const ahead = [x + (0.6 * radius * vx) / speed, y + (0.6 * radius * vy) / speed];
    this.disc(ahead, 0.28 * radius, COLOURS.personNose);
  }

  drawRobot([x, y, yaw]) {
    const radius = this.scene.robot_radius_m;
    const { context } = this;
    context.save();
    context.shadowColor = "rgb(20 40 90 / .45)";
    context.shadowBlur = Math.min(14, 0.3 * this.scale);
    this.disc([x, y], radius, COLOURS.robot);
    context.restore();
    this.ring([x, y], radius, "#ffffff", 1.5);
    const nose = 0.56 * radius;
    this.disc([x + nose * Math.cos(yaw), y + nose * Math.sin(yaw)], 0.3 * radius, COLOURS.nose);
  }

  drawWalls() {
    const { context } = this;
    context.lineJoin = "miter";
    context.strokeStyle = COLOURS.wall;
    context.lineWidth = Math.min(6, Math.max(3, 0.12 * this.scale));
    this.scene.walls_m.forEach((wall, index) => {
      this.path(wall);
      if (index > 0) { context.fillStyle = COLOURS.wall; context.fill(); }
      context.stroke();
    });
  }

  cellKey([x, y]) {
    const size = this.scene.cell_size_m;
    const [left, bottom] = this.scene.bounds_m;
    return `${Math.floor((x - left) / size)},${Math.floor((y - bottom) / size)}`;
  }
}

function centre(corners) {
  const sum = corners.reduce(([x, y], corner) => [x + corner[0], y + corner[1]], [0, 0]);
  return sum.map((value) => value / corners.length);
}
