"""The template of the report."""

#: Style of all pages. One colour a meaning, the same in light, dark and print.
STYLE = """:root { --ink: #222; --soft: #666; --paper: #fff; --line: #ddd; --head: #f4f4f4; --assumed: #fff3cd;
  --run: #1f5fa8; --certified: #1a8045; --limit: #c0392b }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e4e4; --soft: #aaa; --paper: #16181b; --line: #3a3d42;
  --head: #23262a; --assumed: #4a3f16; --run: #6aa5e8; --certified: #4cbf7d; --limit: #ea7a6c } }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1000px; margin: 2em auto; padding: 0 1em;
  color: var(--ink); background: var(--paper) }
table { border-collapse: collapse; margin: 1em 0; width: 100% } td, th { padding: .3em .7em; text-align: left;
  border-bottom: 1px solid var(--line); vertical-align: top } th { background: var(--head) } .n { text-align: right }
.wide { overflow-x: auto } h1 { margin-bottom: 0 } h2 { margin-top: 2em } .soft { color: var(--soft) }
.assumed td { background: var(--assumed) }
.proved { color: var(--certified); font-weight: 600 }
.refused, .refuted, .undecided { color: var(--limit); font-weight: 600 }
.verdict { font-size: 1.15em; border-left: 5px solid var(--certified); padding: .3em .9em }
.verdict.bad { border-color: var(--limit) }
.bar { display: grid; grid-template-columns: 11em 1fr 17em; gap: .8em; align-items: center; margin: .35em 0 }
.track { position: relative; height: 1.1em; background: var(--head); border-right: 3px solid var(--limit) }
.track i { position: absolute; left: 0; top: 0; bottom: 0 }
.track .certified { border: 2px solid var(--certified); border-right-width: 4px }
.track .simulated { background: var(--run); opacity: .85; top: 4px; bottom: 4px }
.key { display: inline-block; width: .9em; height: .9em; margin: 0 .3em 0 1em; vertical-align: -1px }
figure { margin: 1em 0; break-inside: avoid } #machine { width: 100%; max-height: 22em; background: var(--head) }
@media (max-width: 700px) { .bar { grid-template-columns: 1fr } }
@media print { :root { --ink: #000; --soft: #444; --paper: #fff; --line: #bbb; --head: #eee; --assumed: #fff3cd;
  --run: #1f5fa8; --certified: #1a8045; --limit: #c0392b } body { max-width: none; margin: 0 }
  tr, .bar { break-inside: avoid } .control { display: none } h2 { break-after: avoid } }
"""

#: Beginning of all pages, up to what they add to the style.
HEAD = (
    """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>
"""
    + STYLE
)

#: Jinja2 template; `report.py` fills it in.
PAGE = (
    HEAD
    + """</style></head><body>
<h1>{{ name }}</h1><p class="soft">{{ summary }}</p>
<p class="verdict{{ '' if proved else ' bad' }}"><span class="{{ 'proved' if proved else 'refused' }}">
{{- 'proved' if proved else 'not proved' }}</span>: {{ sentence }}</p>
{% for v in refusals %}<p><span class="{{ v.verdict }}">{{ v.verdict }}</span> {{ v.label }}: {{ v.statement }}
{% if v.plain %}<span class="soft">(what must hold: {{ v.plain }})</span>{% endif %}
{% if v.remedy %}<br>Would help: {{ v.remedy }}.{% endif %}</p>{% endfor %}

<h2>Limits</h2>
<p class="soft"><span class="key" style="background: var(--run)"></span>largest in the simulated runs
{% if proved %}<span class="key" style="border: 2px solid var(--certified)"></span>certified: never more{% endif %}
<span class="key" style="background: var(--limit)"></span>the limit</p>
{% for b in bars %}<div class="bar"><span>{{ b.label }}</span><div class="track">
{% if b.certified is not none %}<i class="certified" style="width: {{ b.certified_width }}%"></i>{% endif %}
<i class="simulated" style="width: {{ b.simulated_width }}%"></i></div>
<span>{% if b.certified is not none %}{{ b.certified }} certified, {% endif %}{{ b.simulated }} simulated
<span class="soft">of {{ b.limit }}</span></span></div>{% endfor %}

{% if animation %}<h2>Motion</h2><figure><svg id="machine" viewBox="-20 -20 {{ animation.width + 40 }}
 {{ animation.height + 40 }}" role="img" aria-label="the machine along its motion">
<polyline id="wanted" fill="none" stroke="#8a8a8a" stroke-width="3" stroke-dasharray="6 5"/>
<polyline id="real" fill="none" stroke="var(--run)" stroke-width="5" stroke-linejoin="round" stroke-linecap="round"/>
</svg><div class="control"><button id="play" type="button">play</button>
<input id="when" type="range" min="0" max="{{ animation.t|length - 1 }}" value="0" aria-label="time">
<span id="clock"></span></div><figcaption class="soft">Run "{{ animation.name }}" in the {{ animation.axes }} plane;
dashed grey: the reference.</figcaption></figure>
<script>
(function () {
  const data = {{ animation.json }}, real = document.getElementById("real"), wanted = document.getElementById("wanted");
  const when = document.getElementById("when"), clock = document.getElementById("clock");
  const button = document.getElementById("play");
  let timer = null;
  function draw(k) {
    const text = points => points.map(p => p.join(",")).join(" ");
    real.setAttribute("points", text(data.real[k])); wanted.setAttribute("points", text(data.wanted[k]));
    clock.textContent = data.t[k].toFixed(2) + " s"; when.value = k;
  }
  function stop() { clearInterval(timer); timer = null; button.textContent = "play"; }
  button.addEventListener("click", function () {
    if (timer !== null) { stop(); return; }
    button.textContent = "stop";
    timer = setInterval(function () { draw((Number(when.value) + 1) % data.t.length); }, 60);
  });
  when.addEventListener("input", function () { stop(); draw(Number(when.value)); });
  draw(0);
})();
</script>{% endif %}

{% for title, figures in sections %}<h2>{{ title }}</h2>
{% if loop.first %}<p class="soft">Blue: runs inside the assumptions; purple: the worst that was found; orange: outside
the assumptions; green: certified; red: limits and requirements; grey: the reference.
Simulated with assumed parameters (see the table).</p>{% endif %}
{% for figure in figures %}<figure>{{ figure }}</figure>{% endfor %}{% endfor %}

{% if worst %}<h2>{{ worst.title }}</h2><p>{{ worst.text }}</p>
<table><tr><th>of the run<th>value</tr>
{% for key, value in worst.rows %}<tr><td>{{ key }}<td>{{ value }}</tr>{% endfor %}</table>
{% endif %}

<h2>Assumptions: the assumed first, to be replaced by yours</h2>
{% if bundled %}<p>{{ bundled }}.</p>{% endif %}
<div class="wide"><table><tr><th>number<th class="n">value<th>unit<th class="n">tolerance<th>source<th>meaning</tr>
{% for p in parameters %}<tr class="{{ p.source }}"><td>{{ p.member }}{{ p.name }}
<td class="n">{{ "%.6g"|format(p.value) }}<td>{{ p.unit }}
<td class="n">{% if p.tolerance is not none %}&plusmn;{{ "%.3g"|format(100 * p.tolerance) }} %{% endif %}
<td>{{ p.source }}<td>{{ p.meaning }}</tr>
{% endfor %}</table></div>
<table><tr><th>quantity<th class="n">from<th class="n">to<th>unit<th>source</tr>
{% for a in assumptions %}<tr class="{{ a.source }}"><td>{{ a.member }}{{ a.name }}
<td class="n">{{ "%.6g"|format(a.lower + 0) }}<td class="n">{{ "%.6g"|format(a.upper) }}<td>{{ a.unit }}
<td>{{ a.source }}</tr>
{% endfor %}
<tr><td>control rate<td class="n">{{ rate }}<td class="n">{{ rate }}<td>Hz<td>study</tr></table>
<p class="soft">Tolerances are assumed wherever the source gives none. Noise bounds hold at every sample; initial errors
are those of the subsystems at the start.
{% if sha %}The statement and its proof have the hash {{ sha }}.{% endif %}</p>

{% if requirements %}<h2>Requirements</h2>
<table><tr><th>requirement<th class="n">required<th class="n">certified<th class="n">simulated</tr>
{% for r in requirements %}<tr><td>{{ r.name }}<td class="n">{{ "%.5g"|format(r.required) }}
<td class="n">{{ upward(r.certified, 5) if r.certified is not none else "simulated only" }}
<td class="n">{{ "%.5g"|format(r.simulated) if r.simulated is not none else "" }}</tr>{% endfor %}</table>
<p class="soft">Simulated figures agree with the proof; they prove nothing. {{ drawn }}</p>{% endif %}

{% if obligations %}<h2>Obligations</h2>
<div class="wide"><table><tr><th>obligation<th>verdict<th class="n">margin<th>unit<th>statement</tr>
{% for o in obligations %}<tr><td>{{ o.label }}<td class="{{ o.verdict }}">{{ o.verdict }}
<td class="n">{{ o.margin }}<td>{{ o.unit }}<td>{{ o.statement }}
{% if o.plain %}<br><span class="soft">{{ o.plain }}</span>{% endif %}</tr>{% endfor %}</table></div>{% endif %}

<h2>Gains</h2>
<table><tr><th>gain<th class="n">value<th>unit<th>meaning</tr>
{% for g in gains %}<tr><td>{{ g.member }}{{ g.name }}<td class="n">{{ g.value }}<td>{{ g.unit }}
<td>{{ g.meaning }}</tr>
{% endfor %}</table>
<script>
(function () {
  function paint() {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
    document.querySelectorAll(".js-plotly-plot").forEach(function (plot) {
      Plotly.relayout(plot, { "font.color": ink, "xaxis.gridcolor": line, "yaxis.gridcolor": line,
        "xaxis.zerolinecolor": line, "yaxis.zerolinecolor": line });
    });
  }
  window.addEventListener("load", paint);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  window.addEventListener("beforeprint", paint);
  window.addEventListener("afterprint", paint);
})();
</script></body></html>
"""
)
