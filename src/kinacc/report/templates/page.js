// Draws the pictures, first those near the window, in the colours of the page; sets what a control
// says; tells what is selected; puts the pictures on paper as images.
(() => {
  "use strict";
  const {documents, places} = JSON.parse(document.getElementById("pictures").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 40rem)").matches;
  const touched = window.matchMedia("(pointer: coarse)").matches;
  let printing = false;
  const opened = {};   // documents by name
  const drawn = {};    // promises by document

  const colours = () => dark.matches && !printing
    ? {ink: "#ececf0", muted: "#a9a9b2", line: "#3a3b42", paper: "#16171a"}
    : {ink: "#1d1d1f", muted: "#5a5a5f", line: "#e2e2e6", paper: "#ffffff"};

  function paint(plot) {
    const {ink, muted, line, paper} = colours();
    const text = (model, prefix) => { model[`${prefix}_text_color`] = ink; };
    for (const side of ["left", "right", "above", "below", "center"]) {
      for (const part of plot[side]) {
        if (part.type === "Grid") part.grid_line_color = line;
        if (part.type.endsWith("Axis")) {
          text(part, "axis_label"); text(part, "major_label");
          part.axis_label_text_font_style = "normal";
          part.axis_label_text_font_size = part.major_label_text_font_size = "13px";
          part.axis_line_color = part.major_tick_line_color = muted;
          part.minor_tick_line_color = null;
        }
        if (part.type === "Legend") {
          text(part, "label"); part.background_fill_color = paper;
          part.background_fill_alpha = 0.8; part.border_line_color = null;
          part.spacing = narrow ? 2 : 8;
          if (narrow) { part.label_text_font_size = "11px"; part.padding = part.label_standoff = 2; }
        }
        if (part.type === "ColorBar") {
          text(part, "title"); text(part, "major_label"); part.background_fill_color = null;
          part.title_text_font_style = "normal"; part.major_label_text_font_size = "13px";
        }
        if (part.type === "Title") part.text_color = ink;
        if (part.type === "Label" || part.type === "LabelSet") part.text_color = ink;
      }
    }
    if (plot.title) plot.title.text_color = ink;
    for (const {selection_glyph: picked} of plot.renderers) {
      if (picked?.type !== "Scatter") continue;
      picked.line_color = ink;  // a ring that is seen among points of any colour
      picked.line_width = 4;
      picked.line_alpha = picked.fill_alpha = 1;
    }
    if (touched) plot.toolbar.active_drag = null;  // a finger moves the page, not the picture
  }

  function open(name) {
    opened[name] ??= Bokeh.require("document").Document.from_json(documents[name]);
    return opened[name];
  }

  function root(key) {
    const {document: name, root: id} = places[key];
    return open(name).roots().find((each) => each.id === id);
  }

  function data(plot) {
    return plot.renderers.map((each) => each.data_source).find((each) => each.name);
  }

  function shown(value) {
    if (typeof value !== "number") return String(value);
    if (!Number.isFinite(value)) return "none";
    return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(4)));
  }

  function tell(key, source) {
    const place = document.getElementById(`details-${key}`);
    const row = source.selected.indices[0];
    if (!place || row === undefined) return;
    const {details, names} = places[key];
    const said = Object.entries(details).filter(([column]) => source.data[column]).map(
      ([column, words]) => {
        const value = source.data[column][row];
        return [names[column] ? names[column][value] : value, words];
      },
    ).filter(([value]) => value != null && !Number.isNaN(value)).map(
      ([value, words]) => words.replace("{}", () => shown(value)),
    );
    const more = source.selected.indices.length - 1;
    place.textContent = said.join("; ") + (more > 0 ? `; and ${more} more at the same place` : "");
  }

  // Pictures that share data stand in one document, and are drawn together.
  function draw(key) {
    const name = places[key].document;
    drawn[name] ??= (async () => {
      const keys = Object.keys(places).filter((each) => places[each].document === name);
      const elements = open(name).roots().map((plot) => {
        paint(plot);
        const own = keys.find((each) => places[each].root === plot.id);
        return document.getElementById(`plot-${own}`);
      });
      await Bokeh.embed.add_document_standalone(open(name), elements[0], elements, false);
      for (const each of keys) {
        // No key does anything in a picture, and what it tells stands in words and tables.
        Bokeh.index.get(root(each)).canvas_view.events_el.tabIndex = -1;
        const source = data(root(each));
        source.selected.properties.indices.change.connect(() => tell(each, source));
      }
    })();
    return drawn[name];
  }

  const everything = () => Promise.all(Object.keys(places).map(draw));
  const repaint = () => Object.keys(drawn).forEach((name) => open(name).roots().forEach(paint));

  // A browser prints what is there when this returns: no picture can be laid out or painted anew.
  function toPaper() {
    printing = true;
    repaint();
    for (const key of Object.keys(places)) {
      const view = drawn[places[key].document] && Bokeh.index.get(root(key));
      if (!view) continue;
      view.paint();  // the legend was made anew by its colours, and its marks are drawn here
      const image = document.createElement("img");
      image.className = "paper";
      image.alt = "";  // the picture beside it is described
      image.src = view.export("png", true).canvas.toDataURL();
      const place = document.getElementById(`plot-${key}`);
      const chosen = document.createElement("p");
      chosen.className = "paper";
      chosen.textContent = [...place.closest("figure").querySelectorAll("select")].map(
        (each) => `${each.labels[0].firstChild.data.trim()}: ${each.selectedOptions[0].text}`,
      ).join("; ");
      place.after(chosen, image);
    }
  }

  function fromPaper() {
    printing = false;
    document.querySelectorAll(".paper").forEach((each) => each.remove());
    repaint();
  }

  dark.addEventListener("change", repaint);
  window.addEventListener("beforeprint", toPaper);
  window.addEventListener("afterprint", fromPaper);

  const near = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (entry.isIntersecting) {
        near.unobserve(entry.target);
        draw(entry.target.id.replace("plot-", ""));
      }
    }
  }, {rootMargin: "600px"});
  document.querySelectorAll(".plot").forEach((each) => near.observe(each));

  // The others while the reader reads, one document at a time, so that all are there to be printed.
  const later = window.requestIdleCallback ?? ((todo) => setTimeout(todo, 200));
  function drawRest() {
    const key = Object.keys(places).find((each) => !drawn[places[each].document]);
    if (key) draw(key).then(() => later(drawRest));
  }
  window.addEventListener("load", () => later(drawRest));

  // A glyph and those that take its place while something is selected.
  function looks(name, model) {
    const drawn = open(name).roots().flatMap((plot) => plot.renderers);
    const own = drawn.filter((each) => each.glyph === model);
    const others = own.flatMap((each) => [each.selection_glyph, each.nonselection_glyph]);
    return [model, ...others.filter((each) => each && each !== model && each.properties)];
  }

  function set(select) {
    const {document: name} = places[select.dataset.picture];
    for (const [model, property, value] of JSON.parse(select.value)) {
      for (const each of looks(name, open(name).get_model_by_name(model))) each[property] = value;
    }
  }

  function choose(key, control, option) {
    const select = [...document.querySelectorAll("select[data-picture]")].find(
      ({dataset}) => dataset.picture === key && dataset.control === control);
    select.selectedIndex = [...select.options].findIndex((each) => each.text === option);
    set(select);
  }

  document.addEventListener("change", (event) => {
    const select = event.target.closest("select[data-picture]");
    if (select) set(select);
  });
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-pick]");
    if (!button) return;
    const key = button.dataset.picture;
    JSON.parse(button.dataset.choices ?? "[]").forEach(([control, option]) =>
      choose(key, control, option));
    document.getElementById(`plot-${key}`).scrollIntoView({block: "center"});
    draw(key).then(() => {
      data(root(key)).selected.indices = [Number(button.dataset.pick)];
    });
  });
  window.kinacc = {everything, root, data};
})();
