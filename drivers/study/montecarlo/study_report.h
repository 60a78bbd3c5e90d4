#pragma once
#include <string>
#include <vector>

#include "drivers/study/montecarlo/study.h"
#include "drivers/study/report/errors_json.h"

namespace epiline {

/// montecarlo.txt: errors, consistency and times of each flight with each factor.
std::string study_text(const std::vector<StudyCell>& cells, const StudyOptions& options);

/// montecarlo.json: the same and every run.
Json study_json(const std::vector<StudyCell>& cells, const StudyOptions& options);

}  // namespace epiline
