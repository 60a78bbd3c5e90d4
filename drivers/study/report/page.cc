#include "drivers/study/report/page.h"

#include <fmt/format.h>

#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

constexpr const char* kStyle = R"css(
:root{--bg:#f6f7f9;--card:#fff;--ink:#1c2430;--soft:#66707f;--line:#e3e7ec;--c1:#1667b7;--c2:#d9822b;--c3:#2f9e5f;--c4:#8a5cc2;--truth:#9aa4b1;
--good:#2f9e5f;--warn:#d9a22b;--bad:#cf3f3f}
@media(prefers-color-scheme:dark){:root{--bg:#12161c;--card:#1b212a;--ink:#e6eaf0;--soft:#98a3b3;--line:#2b333f;--c1:#5aa6ee;--c2:#f0a45b;--c3:#5cc48b;
--c4:#b491e6;--truth:#6d7888}}
*{box-sizing:border-box}body{margin:0;background:var(--bg);color:var(--ink);font:15px/1.5 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:1240px;margin:0 auto;padding:28px 20px 48px}h1{font-size:26px;margin:0}h2{font-size:16px;margin:0 0 2px}
p{margin:2px 0;color:var(--soft)}header p{font-size:14px}.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(250px,1fr));gap:12px;margin:20px 0}
.tile,.card{background:var(--card);border:1px solid var(--line);border-radius:10px}.tile{padding:12px 14px}.tile b{display:block;font-size:22px;
line-height:1.25;font-variant-numeric:tabular-nums}.tile span{font-size:12.5px;color:var(--soft)}.grid2{display:grid;grid-template-columns:
repeat(auto-fit,minmax(min(100%,520px),1fr));gap:14px}.card{padding:14px 16px 8px}.wide{grid-column:1/-1}.card p{font-size:13px}
.three{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,330px),1fr));gap:6px}.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,480px),1fr));gap:10px}
.two h3,.three h3{font-size:13px;margin:8px 0 0;font-weight:600}
svg{display:block;width:100%;height:auto}.grid{stroke:var(--line);stroke-width:1;fill:none}.tick,.legend{font-size:11px;fill:var(--soft)}
.label{font-size:11.5px;fill:var(--soft)}.line{fill:none;stroke-width:1.6;stroke-linejoin:round}.c1{stroke:var(--c1)}.c2{stroke:var(--c2)}.c3{stroke:var(--c3)}
.c4{stroke:var(--c4)}.truth{stroke:var(--truth);stroke-width:2.4}.dashed{stroke-dasharray:5 4;stroke-width:1.2}.thin{stroke-width:1}
.band{stroke:none;opacity:.16}.band.c1,.bar.c1{fill:var(--c1)}.band.c2,.bar.c2{fill:var(--c2)}.band.c3,.bar.c3{fill:var(--c3)}.bar{stroke:none;opacity:.85}
.rule{stroke:var(--soft);stroke-dasharray:3 3;fill:none}.mark{stroke:var(--card);stroke-width:1.5}.mark.c1{fill:var(--c1)}.mark.truth{fill:var(--truth)}
.span{opacity:.22}.initialising{fill:var(--truth)}.tracking{fill:var(--good)}.degraded{fill:var(--warn)}.lost{fill:var(--bad)}
.key i{display:inline-block;width:11px;height:11px;border-radius:3px;margin:0 5px 0 12px}.key i:first-child{margin-left:0}
table{border-collapse:collapse;width:100%;font-size:13.5px;font-variant-numeric:tabular-nums;margin:6px 0 10px}td,th{padding:4px 8px;text-align:right;
border-bottom:1px solid var(--line);font-weight:400}th{color:var(--soft)}td:first-child,th:first-child{text-align:left}
.wide table{white-space:nowrap}.texts td,.texts th{text-align:left}.texts td:last-child{white-space:normal;min-width:180px}td b{font-weight:650;color:var(--bad)}
.tile b small{font-size:13px;font-weight:400;color:var(--soft)}
)css";

}  // namespace

std::string html_page(const std::string& title, const std::string& subtitle, const std::string& body) {
  return fmt::format(
      "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>epiline: {0}</title><style>{2}</style><main><header>"
      "<h1>{0}</h1><p>{1}</p></header>{3}</main></html>\n",
      escaped(title), escaped(subtitle), kStyle, body);
}

std::string html_card(const std::string& title, const std::string& note, const std::string& content, bool wide) {
  return fmt::format(R"(<section class="card{}"><h2>{}</h2><p>{}</p>{}</section>)", wide ? " wide" : "", title, note,
                     content);
}

std::string html_tile(const std::string& value, const std::string& text) {
  return fmt::format(R"(<div class="tile"><b>{}</b><span>{}</span></div>)", value, text);
}

std::string html_table(const HtmlRow& head, const std::vector<HtmlRow>& rows, bool texts) {
  std::string s = texts ? R"(<table class="texts">)" : "<table>";
  const auto add = [&s](const HtmlRow& row, const char* cell) {
    s += "<tr>";
    for (const std::string& text : row) s += fmt::format("<{0}>{1}</{0}>", cell, text);
    s += "</tr>";
  };
  if (!head.empty()) add(head, "th");
  for (const HtmlRow& row : rows) add(row, "td");
  return s + "</table>";
}

std::string program_text(const ProgramInfo& program) {
  return fmt::format("epiline {} ({}, {}, {})", program.version, program.commit, program.build_type, program.simd);
}

}  // namespace epiline
