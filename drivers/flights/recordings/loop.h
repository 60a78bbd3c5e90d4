#pragma once
#include "drivers/flights/recordings/asl_dataset.h"

namespace epiline {

/// Makes the flight last `seconds` of images by flying it again and again. Between two rounds the stamps leave a gap of
/// 6 s, so that each round is a new start: the body cannot have come back in no time. Ground truth is that of the first
/// round.
void loop_flight(AslDataset& dataset, double seconds);

}  // namespace epiline
