#pragma once
#include "drivers/flights/recordings/asl_dataset.h"

namespace epiline {

/// Repeats the flight until it has `seconds` of images. A gap of 6 s in the timestamps separates the rounds, so that
/// each round is a new start. Ground truth covers the first round only.
void loop_flight(AslDataset& dataset, double seconds);

}  // namespace epiline
