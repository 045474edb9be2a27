// Which layer of the learned model is drawn, and its legend.

const PARTS = ["overlays", "layer", "layer-title", "layer-scale", "layer-low", "layer-high", "layer-note"];

export class Overlay {
  constructor(view, press) {
    this.view = view;
    this.name = "";
    this.parts = Object.fromEntries(PARTS.map((id) => [id, document.getElementById(id)]));
    this.buttons = [...document.querySelectorAll("[data-layer]")];
    for (const button of this.buttons) press(button, () => this.choose(button.dataset.layer));
    this.choose("");
  }

  // The layers of a new model in place of those before, null for none.
  take(layers) {
    this.layers = layers;
    this.parts.overlays.hidden = !layers;
    this.choose(this.name);
  }

  choose(name) {
    this.name = name;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.layer === name));
    const layer = this.layers?.[name] ?? null;
    this.parts.layer.hidden = !layer;
    if (layer) this.showLegend(layer);
    this.view.setLayer(layer);
  }

  showLegend({ title, note, low = "", high = "", shades }) {
    const { parts } = this;
    parts["layer-scale"].hidden = !shades;
    for (const [part, text] of Object.entries({ title, note, low, high })) parts[`layer-${part}`].textContent = text;
  }
}
