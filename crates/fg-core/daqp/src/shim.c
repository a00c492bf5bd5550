/* One DAQP workspace that is set up once and then updated, as a control loop would, behind three functions. */
#include "api.h"
#include "utils.h"
#include <stdlib.h>
#include <string.h>

typedef struct {
  DAQPWorkspace workspace;
  DAQPProblem qp;
  DAQPResult result;
  int ready;
} Solver;

Solver *fg_daqp_new(int n, int m, double tolerance) {
  Solver *s = calloc(1, sizeof(Solver));
  s->qp.n = n;
  s->qp.m = m;
  s->qp.ms = 0;
  s->result.x = calloc(n, sizeof(double));
  s->result.lam = calloc(m, sizeof(double));
  allocate_daqp_settings(&s->workspace);
  s->workspace.settings->primal_tol = tolerance;
  return s;
}

/* The exit flag: 1 where solved. The working set of the last call is where this one starts. */
int fg_daqp_solve(Solver *s, double *H, double *f, double *A, double *upper, double *lower, double *x) {
  s->qp.H = H;
  s->qp.f = f;
  s->qp.A = A;
  s->qp.bupper = upper;
  s->qp.blower = lower;
  s->qp.sense = NULL;
  int flag;
  if (!s->ready) {
    flag = setup_daqp_main(&s->qp, &s->workspace, NULL, 0);
    s->ready = flag >= 0;
  } else {
    flag = daqp_update_ldp(DAQP_UPDATE_Rinv | DAQP_UPDATE_M | DAQP_UPDATE_v | DAQP_UPDATE_d, &s->workspace, &s->qp);
  }
  if (flag < 0)
    return flag;
  daqp_solve(&s->result, &s->workspace);
  memcpy(x, s->result.x, s->qp.n * sizeof(double));
  return s->result.exitflag;
}
