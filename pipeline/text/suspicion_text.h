#pragma once
// What a flight says of the user's numbers, in words.
#include <string>
#include <vector>

#include "estimator/statistics.h"
#include "platform/log/event.h"

namespace epiline {

/// One word, the same in events.txt and stats.json.
const char* to_string(Suspect suspect) noexcept;
const char* to_string(Severity severity) noexcept;

/// One sentence without a full stop: what was seen, and which number to look at.
std::string text_of(Suspect suspect, const Suspicion& suspicion);

/// Those raised, the gross ones first.
std::vector<std::string> texts_of(const Suspicions& suspicions);

/// A suspicion as an event's arguments, and back: figure in millionths; of kMirrored the axes.
Event event_of(HostStamp stamp, Suspect suspect, const Suspicion& suspicion) noexcept;
std::string text_of(const Event& number_wrong);

}  // namespace epiline
