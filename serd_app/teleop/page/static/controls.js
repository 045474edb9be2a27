// The driver's input: keys, pad and gamepad, sent ten times a second.
// A page that loses the focus sends "away", which stops the robot, and then nothing.

const HEARTBEAT_MS = 100;
const CLICK_MS = 1000;
const STICK = 0.5;
const KEY_DIRECTIONS = { ArrowUp: "north", ArrowRight: "east", ArrowDown: "south", ArrowLeft: "west" };
const STEPS = { north: [1, 0], south: [-1, 0], west: [0, 1], east: [0, -1] };
// The standard gamepad: B stops, Y saves, back discards, start starts, the left trigger overrides the
// guard, 12 to 15 are the cross.
const PAD_BUTTONS = { 1: "stop", 3: "save", 8: "discard", 9: "start" };
const PAD_OVERRIDE = 6;
const PAD_DIRECTIONS = { 12: "north", 13: "south", 14: "west", 15: "east" };

export class Controls {
  constructor({ link, actions, pad }) {
    this.link = link;
    this.actions = actions;
    this.mode = "directions";
    this.held = [];
    this.overrides = false;
    this.padButtons = [];
    this.gamepadName = "";
    this.isInFront = document.hasFocus();
    this.listenToKeys();
    this.listenToPad(pad);
    this.listenToFocus();
    setInterval(() => this.send(), HEARTBEAT_MS);
  }

  listenToKeys() {
    const commands = {
      Enter: "start", s: "save", d: "discard", " ": "stop", r: "release", m: "switchMode",
    };
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      // Enter on a control that has the focus is for that control; Space stops the robot anywhere.
      if (event.key === "Enter" && event.target.closest("button")) {
        if (event.repeat) event.preventDefault(); // one press is one click
        return;
      }
      const command = commands[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (KEY_DIRECTIONS[event.key]) {
        if (!event.repeat) this.hold(KEY_DIRECTIONS[event.key]);
      } else if (event.key.toLowerCase() === "g") {
        this.overrides = true;
        if (!event.repeat) this.send();
      } else if (command && !event.repeat) this.actions[command]();
      else if (!command) return;
      event.preventDefault();
    });
    addEventListener("keyup", (event) => {
      if (KEY_DIRECTIONS[event.key]) this.release(KEY_DIRECTIONS[event.key]);
      if (event.key.toLowerCase() === "g") this.overrides = false;
      if (event.key === " ") event.preventDefault();
    });
  }

  listenToPad(pad) {
    for (const button of pad.querySelectorAll("[data-direction]")) {
      const direction = button.dataset.direction;
      button.addEventListener("pointerdown", (event) => {
        button.setPointerCapture(event.pointerId);
        this.hold(direction);
        event.preventDefault();
      });
      for (const ending of ["pointerup", "pointercancel", "lostpointercapture"]) {
        button.addEventListener(ending, () => this.release(direction));
      }
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      button.addEventListener("keydown", (event) => {
        if (event.key !== "Enter") return;
        if (!event.repeat) this.hold(direction);
        event.preventDefault();
      });
      button.addEventListener("keyup", (event) => { if (event.key === "Enter") this.release(direction); });
      button.addEventListener("blur", () => this.release(direction));
      // A screen reader clicks without pointer or key: the direction is held for a while.
      button.addEventListener("click", (event) => {
        if (event.detail) return;
        this.hold(direction);
        setTimeout(() => this.release(direction), CLICK_MS);
      });
    }
  }

  listenToFocus() {
    const leave = () => {
      this.held = [];
      this.overrides = false;
      this.isInFront = false;
      this.link.send({ type: "away" });
    };
    // The first message has nothing held, since the server ignores what was held before.
    const enter = () => {
      if (this.isInFront) return;
      this.isInFront = true;
      this.send();
    };
    const update = () => {
      if (document.visibilityState === "visible" && document.hasFocus()) enter();
      else this.isInFront = false;
    };
    addEventListener("blur", leave);
    addEventListener("pagehide", leave);
    addEventListener("focus", update);
    addEventListener("pointerdown", enter, { capture: true });
    document.addEventListener("visibilitychange", () => (document.hidden ? leave() : update()));
  }

  hold(direction) {
    if (this.held.includes(direction)) return;
    this.held.push(direction);
    this.send();
  }

  release(direction) {
    if (!this.held.includes(direction)) return;
    this.held = this.held.filter((each) => each !== direction);
    this.send();
  }

  // In mode "directions" the direction held last counts; in mode "velocity" all held ones add up.
  send() {
    if (!this.isInFront) return;
    const gamepad = [...(navigator.getGamepads?.() ?? [])].find((each) => each?.connected);
    this.gamepadName = gamepad ? gamepad.id : "";
    if (gamepad) this.pressGamepad(gamepad);
    if (this.overrides || gamepad?.buttons[PAD_OVERRIDE]?.pressed) this.link.send({ type: "override" });
    if (this.mode === "directions") {
      const direction = this.held.at(-1) ?? (gamepad ? gamepadDirection(gamepad) : null);
      this.link.send({ type: "hold", direction });
      return;
    }
    if (gamepad) this.link.send(joyOf(gamepad));
    const steps = this.held.map((direction) => STEPS[direction]);
    const [linear, angular] = [0, 1].map((index) => steps.reduce((sum, step) => sum + step[index], 0));
    this.link.send({ type: "move", linear: clip(linear), angular: clip(angular) });
  }

  pressGamepad(gamepad) {
    for (const [index, command] of Object.entries(PAD_BUTTONS)) {
      const isPressed = Boolean(gamepad.buttons[index]?.pressed);
      if (isPressed && !this.padButtons[index]) this.actions[command]();
      this.padButtons[index] = isPressed;
    }
  }
}

function gamepadDirection(gamepad) {
  const pressed = Object.keys(PAD_DIRECTIONS).find((index) => gamepad.buttons[index]?.pressed);
  if (pressed) return PAD_DIRECTIONS[pressed];
  const [right = 0, down = 0] = gamepad.axes;
  if (Math.max(Math.abs(right), Math.abs(down)) < STICK) return null;
  if (Math.abs(right) > Math.abs(down)) return right > 0 ? "east" : "west";
  return down > 0 ? "south" : "north";
}

// Browsers count right and down positive, ROS left and up.
function joyOf(gamepad) {
  return {
    type: "joy",
    axes: [...gamepad.axes].slice(0, 16).map((value) => clip(-value)),
    buttons: [...gamepad.buttons].slice(0, 32).map((button) => Number(button.pressed)),
  };
}

function clip(value) {
  return Math.min(1, Math.max(-1, value)) + 0;
}
