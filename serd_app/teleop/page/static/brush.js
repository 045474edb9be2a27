// Draws on a canvas in metres: x east, y north, a rectangle of the map as large as it fits.

const MARGIN_PX = 22;
const LARGEST_SCALE = 90;

export class Brush {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  fitTo([left, bottom, right, top]) {
    const { clientWidth, clientHeight } = this.canvas;
    const density = devicePixelRatio || 1;
    this.canvas.width = Math.round(clientWidth * density);
    this.canvas.height = Math.round(clientHeight * density);
    const room = [clientWidth - 2 * MARGIN_PX, clientHeight - 2 * MARGIN_PX];
    const fitting = Math.min(room[0] / (right - left), room[1] / (top - bottom));
    this.scale = Math.min(LARGEST_SCALE, Math.max(1, fitting));
    this.offset = [
      (clientWidth - this.scale * (right - left)) / 2 - this.scale * left,
      (clientHeight + this.scale * (top - bottom)) / 2 + this.scale * bottom,
    ];
    this.context.setTransform(density, 0, 0, density, 0, 0);
  }

  clear() {
    this.context.clearRect(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
  }

  area(corners, fill, line) {
    this.path(corners);
    this.context.fillStyle = fill;
    this.context.fill();
    if (!line) return;
    this.context.strokeStyle = line;
    this.context.lineWidth = 1.5;
    this.context.stroke();
  }

  label(text, point, colour) {
    const { context } = this;
    context.fillStyle = colour;
    context.font = `600 ${Math.min(20, Math.max(11, 0.42 * this.scale))}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, ...this.at(point));
  }

  path(points) {
    this.context.beginPath();
    for (const point of points) this.context.lineTo(...this.at(point));
    this.context.closePath();
  }

  disc(point, radius, colour) { this.discs([point], radius, colour); }

  discs(points, radius, colour) {
    this.context.beginPath();
    for (const point of points) {
      const [x, y] = this.at(point);
      this.context.moveTo(x + radius * this.scale, y);
      this.context.arc(x, y, radius * this.scale, 0, 2 * Math.PI);
    }
    this.context.fillStyle = colour;
    this.context.fill();
  }

  ring(point, radius, colour, width) {
    this.context.beginPath();
    this.context.arc(...this.at(point), radius * this.scale, 0, 2 * Math.PI);
    this.context.strokeStyle = colour;
    this.context.lineWidth = width;
    this.context.stroke();
  }

  // The square of a side around a point, as a rectangle of the canvas.
  square([x, y], side) {
    const [left, top] = this.at([x - side / 2, y + side / 2]);
    return [left, top, side * this.scale, side * this.scale];
  }

  at([x, y]) {
    return [this.offset[0] + this.scale * x, this.offset[1] - this.scale * y];
  }
}
