// Draws the charts; every chart brings its own controls.
for (const item of Object.values(JSON.parse(document.getElementById("charts").textContent))) {
  Bokeh.embed.embed_item(item);
}
