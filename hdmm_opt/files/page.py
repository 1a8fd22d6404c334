"""The template of the report."""

#: Jinja2 template; `report.py` fills it in.
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{{ name }}</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1000px; margin: 2em auto; padding: 0 1em; color: #222 }
table { border-collapse: collapse; margin: 1em 0; width: 100% } td, th { padding: .3em .7em; text-align: left;
border-bottom: 1px solid #ddd; vertical-align: top } th { background: #f4f4f4 } .n { text-align: right }
.assumed { background: #fff3cd } .proved { color: #136f3a; font-weight: 600 }
.refused, .refuted, .undecided { color: #a4281a; font-weight: 600 } h1 { margin-bottom: 0 }
</style></head><body>
<h1>{{ name }}</h1><p>{{ summary }}</p>
{% if proved %}<p><span class="proved">proved</span>: after the transient |tracking error| &le;
{{ upward(bound) }} m{{ unit }}, for every
load, disturbance and parameter inside the assumptions below, at {{ rate }} Hz. Largest error in
{{ runs }} simulated runs: {{ "%.4g"|format(late) }} m{{ unit }}.</p>
{% else %}<p><span class="refused">not proved</span>: no gain file was written. {{ first }}</p>{% endif %}
{{ plots }}
<h2>Assumed parameters: replace these by yours</h2>
<table><tr><th>parameter<th class="n">value<th>unit<th class="n">tolerance<th>source<th>meaning</tr>
{% for p in parameters %}<tr class="{{ p.source }}"><td>{{ p.member }}{{ p.name }}
<td class="n">{{ "%.6g"|format(p.value) }}
<td>{{ p.unit }}<td class="n">&plusmn;{{ "%.3g"|format(100 * p.tolerance) }} %<td>{{ p.source }}<td>{{ p.meaning }}</tr>
{% endfor %}</table>
<p>Tolerances are assumed wherever the source gives none.</p>
<h2>What else is assumed</h2>
<table><tr><th>quantity<th class="n">from<th class="n">to<th>unit<th>source</tr>
{% for a in assumptions %}<tr><td>{{ a.member }}{{ a.name }}<td class="n">{{ "%.6g"|format(a.lower + 0) }}
<td class="n">{{ "%.6g"|format(a.upper) }}<td>{{ a.unit }}<td>{{ a.source }}</tr>{% endfor %}
{% for x in limits %}<tr class="{{ x.source }}"><td>{{ x.member }}limit on {{ x.name }}
<td class="n">0<td class="n">{{ "%.6g"|format(x.value) }}
<td>{{ x.unit }}<td>{{ x.source }}</tr>{% endfor %}
{% for s in strokes %}<tr><td>{{ s.member }}stroke
<td class="n">{{ "%.6g"|format(s.low) }}<td class="n">{{ "%.6g"|format(s.high) }}
<td>{{ s.unit }}<td>plant</tr>{% endfor %}
<tr><td>control rate<td class="n">{{ rate }}<td class="n">{{ rate }}<td>Hz<td>study</tr></table>
<p>Noise bounds hold at every sample; initial errors are those of the subsystems at the start.
{% if sha %}The statement and its proof have the hash {{ sha }}.{% endif %}</p>
<h2>Obligations</h2>
<table><tr><th>obligation<th>verdict<th class="n">margin<th>unit<th>statement</tr>
{% for o in obligations %}<tr><td>{{ o.member + ": " if o.member else "" }}{{ o.name }}
<td class="{{ o.verdict }}">{{ o.verdict }}
<td class="n">{{ "%.4g"|format(o.margin) if o.margin is not none else "unknown" }}
<td>{{ o.unit }}<td>{{ o.statement }}
{% if o.remedy %} Would help: {{ o.remedy }}.{% endif %}</tr>{% endfor %}</table>
<h2>Requirements</h2>
<table><tr><th>requirement<th class="n">required<th class="n">simulated<th class="n">certified</tr>
{% for r in requirements %}<tr><td>{{ r.name }}<td class="n">{{ "%.5g"|format(r.required) }}
<td class="n">{{ "%.5g"|format(r.simulated) if r.simulated is not none else "" }}<td class="n">
{{ upward(r.certified, 5) if r.certified is not none else "" }}</tr>{% endfor %}</table>
<p>Simulated figures agree with the proof; they prove nothing.</p>
<h2>Gains</h2>
<table><tr><th>gain<th class="n">value<th>unit<th>meaning</tr>
{% for g in gains %}
<tr><td>{{ g.member }}{{ g.name }}<td class="n">{{ g.value }}<td>{{ g.unit }}<td>{{ g.meaning }}</tr>
{% endfor %}</table></body></html>
"""
