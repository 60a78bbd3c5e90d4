#pragma once
// The tables of kernels, one for each instruction set (kernels_*.cc). Plain data, as all that kernels' sources include.
#include "estimator/factors/kernels.h"
#include "estimator/initialise/start_kernels.h"
#include "estimator/monitor/turn_kernels.h"
#include "estimator/solver/linear_system.h"

namespace epiline {

struct KernelTables {
  FactorKernels factors;
  StartKernels starts;
  TurnKernels turns;
  EliminationKernels elimination;
};

}  // namespace epiline
