/* One iteration of either model-predictive controller, with the operations of `build_solver` on the same doubles in
   the same order. mpc_parts.py generates what CasADi derives from the problems; the rest follows mpc_solver.py,
   matrix by matrix. CasADi's DAQP solves the quadratic program; the address of its `daqp_quadprog` is an argument.

   Stands for: mpc_solver.py, horizon.py, lateral_ocp.py, long_ocp.py, ../../common/ordered.py.
*/

#include <math.h>
#include <string.h>

enum { N = 20, SHORT_INTERVALS = 5, STATES = 6, RESIDUALS = 5, ROWS = 2 * N };

static const double FEASIBILITY_TOL = 1e-3, STATIONARITY_TOL = 1e-6, LARGEST = 1e100, LARGEST_GRADIENT = 1e300;

/* DAQPProblem and DAQPResult of DAQP's types.h and api.h; later versions can have more members. */
typedef struct {
    int n, m, ms;
    double *h, *f, *a, *upper, *lower;
    int *sense;
    void *more[16];
} Problem;

typedef struct {
    double *x, *lam, fval, soft_slack;
    int exitflag, iter, nodes;
    double solve_time, setup_time;
    void *more[16];
} Result;

typedef void Quadprog(Result *, Problem *, void *settings);

/* begin: written by mpc_parts.py */
static void long_mpc_rk4(const double *z, const double *u, const double *p, double *end, double *a, double *b, double *over)
{
    double v5 = 0.1 * z[2];
    double v6 = z[1] + v5;
    double v8 = 0.1 * u[0];
    double v9 = z[2] + v8;
    double v10 = 0.1 * v9;
    double v11 = z[1] + v10;
    double v12 = v6 + v11;
    double v13 = 2.0 * v12;
    double v14 = z[1] + v13;
    double v16 = 0.2 * v9;
    double v17 = z[1] + v16;
    double v18 = v14 + v17;
    double v19 = 0.03333333333333333 * v18;
    double v20 = z[0] + v19;
    end[0] = v20;
    double v23 = 4.0 * v9;
    double v24 = z[2] + v23;
    double v25 = 0.2 * u[0];
    double v26 = z[2] + v25;
    double v27 = v24 + v26;
    double v28 = 0.03333333333333333 * v27;
    double v29 = z[1] + v28;
    end[1] = v29;
    double v31 = 4.0 * u[0];
    double v32 = u[0] + v31;
    double v33 = v32 + u[0];
    double v34 = 0.03333333333333333 * v33;
    double v35 = z[2] + v34;
    end[2] = v35;
    double v40 = 0.1 * z[5];
    double v41 = z[4] + v40;
    double v43 = p[0] * z[5];
    double v44 = 0.1 * v43;
    double v45 = z[5] - v44;
    double v46 = 0.1 * v45;
    double v47 = z[4] + v46;
    double v48 = v41 + v47;
    double v49 = 2.0 * v48;
    double v50 = z[4] + v49;
    double v51 = p[0] * v45;
    double v52 = 0.1 * v51;
    double v53 = z[5] - v52;
    double v54 = 0.2 * v53;
    double v55 = z[4] + v54;
    double v56 = v50 + v55;
    double v57 = 0.03333333333333333 * v56;
    double v58 = z[3] + v57;
    end[3] = v58;
    double v60 = v45 + v53;
    double v61 = 2.0 * v60;
    double v62 = z[5] + v61;
    double v63 = p[0] * v53;
    double v64 = 0.2 * v63;
    double v65 = z[5] - v64;
    double v66 = v62 + v65;
    double v67 = 0.03333333333333333 * v66;
    double v68 = z[4] + v67;
    end[4] = v68;
    double v70 = v51 + v63;
    double v71 = -v70;
    double v72 = 2.0 * v71;
    double v73 = v72 - v43;
    double v74 = p[0] * v65;
    double v75 = v73 - v74;
    double v76 = 0.03333333333333333 * v75;
    double v77 = z[5] + v76;
    end[5] = v77;
    a[0] = 1.0;
    a[1] = 0.2;
    a[7] = 1.0;
    a[2] = 0.020000000000000004;
    a[8] = 0.2;
    a[14] = 1.0;
    a[21] = 1.0;
    a[22] = 0.2;
    a[28] = 1.0;
    double v90 = 0.1 * p[0];
    double v91 = 1.0 - v90;
    double v92 = 0.1 * v91;
    double v93 = 0.1 + v92;
    double v94 = 2.0 * v93;
    double v95 = p[0] * v91;
    double v96 = 0.1 * v95;
    double v97 = 1.0 - v96;
    double v98 = 0.2 * v97;
    double v99 = v94 + v98;
    double v100 = 0.03333333333333333 * v99;
    a[23] = v100;
    double v102 = v91 + v97;
    double v103 = 2.0 * v102;
    double v104 = 1.0 + v103;
    double v105 = p[0] * v97;
    double v106 = 0.2 * v105;
    double v107 = 1.0 - v106;
    double v108 = v104 + v107;
    double v109 = 0.03333333333333333 * v108;
    a[29] = v109;
    double v111 = v95 + v105;
    double v112 = -v111;
    double v113 = 2.0 * v112;
    double v114 = v113 - p[0];
    double v115 = p[0] * v107;
    double v116 = v114 - v115;
    double v117 = 0.03333333333333333 * v116;
    double v118 = 1.0 + v117;
    a[35] = v118;
    b[0] = 0.0013333333333333335;
    b[1] = 0.020000000000000004;
    b[2] = 0.2;
    over[23] = v99;
    over[29] = v108;
}

static void long_mpc_stage(const double *zu, const double *p, double *r, double *c, double *over, double *under)
{
    double v4 = 2.0 * zu[1];
    double v6 = v4 - zu[4];
    double v7 = 1.8 * v6;
    double v8 = 4.0 + v7;
    double v9 = zu[1] * zu[1];
    double v10 = zu[4] * zu[4];
    double v11 = v9 - v10;
    double v13 = v11 / 19.62;
    double v14 = v8 + v13;
    double v17 = zu[3] - zu[0];
    double v18 = v14 - v17;
    double v19 = 0.3 * v18;
    double v21 = zu[1] + 0.5;
    double v22 = sqrt(v21);
    double v24 = v22 + 0.1;
    double v25 = v19 / v24;
    double v26 = exp(v25);
    double v28 = v26 - 1.0;
    r[0] = v28;
    double v30 = 0.1 * zu[1];
    double v31 = v30 + 0.5;
    double v32 = v18 / v31;
    double v33 = -v32;
    r[1] = v33;
    double v37 = zu[1] / 10.0;
    double v38 = 1.0 + v37;
    double v39 = zu[2] * v38;
    r[2] = v39;
    double v42 = zu[6] * v38;
    r[3] = v42;
    double v44 = 0.3 / v24;
    double v45 = v26 * v44;
    c[0] = v45;
    double v47 = 1.0 / v31;
    double v48 = -v47;
    c[7] = v48;
    double v52 = 0.1019367991845056 * zu[1];
    double v53 = 3.6 + v52;
    double v54 = 0.3 * v53;
    double v55 = v54 / v24;
    double v56 = v25 / v24;
    double v57 = 2.0 * v22;
    double v58 = v56 / v57;
    double v59 = v55 - v58;
    double v60 = v26 * v59;
    c[1] = v60;
    double v62 = v53 / v31;
    double v63 = v32 / v31;
    double v64 = 0.1 * v63;
    double v65 = v62 - v64;
    double v66 = -v65;
    c[8] = v66;
    double v68 = 0.1 * zu[2];
    c[15] = v68;
    double v70 = 0.1 * zu[6];
    c[22] = v70;
    c[16] = v38;
    double v74 = (-0.3) / v24;
    double v75 = v26 * v74;
    c[3] = v75;
    c[10] = v47;
    double v79 = 0.1019367991845056 * zu[4];
    double v80 = (-1.8) - v79;
    double v81 = 0.3 * v80;
    double v82 = v81 / v24;
    double v83 = v26 * v82;
    c[4] = v83;
    double v85 = v80 / v31;
    double v86 = -v85;
    c[11] = v86;
    c[27] = v38;
    over[15] = zu[2];
    over[22] = zu[6];
    double v91 = -v31;
    under[7] = v91;
    under[10] = v31;
}

static void long_mpc_end(const double *zu, const double *p, double *r, double *c, double *over, double *under)
{
    double v4 = 2.0 * zu[1];
    double v6 = v4 - zu[4];
    double v7 = 1.8 * v6;
    double v8 = 4.0 + v7;
    double v9 = zu[1] * zu[1];
    double v10 = zu[4] * zu[4];
    double v11 = v9 - v10;
    double v13 = v11 / 19.62;
    double v14 = v8 + v13;
    double v17 = zu[3] - zu[0];
    double v18 = v14 - v17;
    double v19 = 0.3 * v18;
    double v21 = zu[1] + 0.5;
    double v22 = sqrt(v21);
    double v24 = v22 + 0.1;
    double v25 = v19 / v24;
    double v26 = exp(v25);
    double v28 = v26 - 1.0;
    r[0] = v28;
    double v30 = 0.1 * zu[1];
    double v31 = v30 + 0.5;
    double v32 = v18 / v31;
    double v33 = -v32;
    r[1] = v33;
    double v37 = zu[1] / 10.0;
    double v38 = 1.0 + v37;
    double v39 = zu[2] * v38;
    r[2] = v39;
    double v41 = 0.3 / v24;
    double v42 = v26 * v41;
    c[0] = v42;
    double v44 = 1.0 / v31;
    double v45 = -v44;
    c[7] = v45;
    double v49 = 0.1019367991845056 * zu[1];
    double v50 = 3.6 + v49;
    double v51 = 0.3 * v50;
    double v52 = v51 / v24;
    double v53 = v25 / v24;
    double v54 = 2.0 * v22;
    double v55 = v53 / v54;
    double v56 = v52 - v55;
    double v57 = v26 * v56;
    c[1] = v57;
    double v59 = v50 / v31;
    double v60 = v32 / v31;
    double v61 = 0.1 * v60;
    double v62 = v59 - v61;
    double v63 = -v62;
    c[8] = v63;
    double v65 = 0.1 * zu[2];
    c[15] = v65;
    c[16] = v38;
    double v69 = (-0.3) / v24;
    double v70 = v26 * v69;
    c[3] = v70;
    c[10] = v44;
    double v74 = 0.1019367991845056 * zu[4];
    double v75 = (-1.8) - v74;
    double v76 = 0.3 * v75;
    double v77 = v76 / v24;
    double v78 = v26 * v77;
    c[4] = v78;
    double v80 = v75 / v31;
    double v81 = -v80;
    c[11] = v81;
    over[15] = zu[2];
    double v84 = -v31;
    under[7] = v84;
    under[10] = v31;
}

static void lateral_mpc_rk4(const double *z, const double *u, const double *p, double *end, double *a, double *b, double *over)
{
    double v4 = cos(z[2]);
    double v5 = p[1] * v4;
    double v8 = p[1] * z[3];
    double v10 = v8 * p[0];
    double v11 = 0.025 * v10;
    double v12 = z[2] + v11;
    double v13 = cos(v12);
    double v14 = p[1] * v13;
    double v16 = 0.025 * u[0];
    double v17 = z[3] + v16;
    double v18 = p[1] * v17;
    double v19 = v18 * p[0];
    double v20 = 0.025 * v19;
    double v21 = z[2] + v20;
    double v22 = cos(v21);
    double v23 = p[1] * v22;
    double v24 = v14 + v23;
    double v25 = 2.0 * v24;
    double v26 = v5 + v25;
    double v28 = 0.05 * v19;
    double v29 = z[2] + v28;
    double v30 = cos(v29);
    double v31 = p[1] * v30;
    double v32 = v26 + v31;
    double v33 = 0.008333333333333333 * v32;
    double v34 = z[0] + v33;
    end[0] = v34;
    double v37 = sin(z[2]);
    double v38 = p[1] * v37;
    double v39 = sin(v12);
    double v40 = p[1] * v39;
    double v41 = sin(v21);
    double v42 = p[1] * v41;
    double v43 = v40 + v42;
    double v44 = 2.0 * v43;
    double v45 = v38 + v44;
    double v46 = sin(v29);
    double v47 = p[1] * v46;
    double v48 = v45 + v47;
    double v49 = 0.008333333333333333 * v48;
    double v50 = z[1] + v49;
    end[1] = v50;
    double v53 = 4.0 * v19;
    double v54 = v10 + v53;
    double v55 = 0.05 * u[0];
    double v56 = z[3] + v55;
    double v57 = p[1] * v56;
    double v58 = v57 * p[0];
    double v59 = v54 + v58;
    double v60 = 0.008333333333333333 * v59;
    double v61 = z[2] + v60;
    end[2] = v61;
    double v63 = 4.0 * u[0];
    double v64 = u[0] + v63;
    double v65 = v64 + u[0];
    double v66 = 0.008333333333333333 * v65;
    double v67 = z[3] + v66;
    end[3] = v67;
    a[0] = 1.0;
    a[5] = 1.0;
    double v72 = -v43;
    double v73 = 2.0 * v72;
    double v74 = v73 - v38;
    double v75 = v74 - v47;
    double v76 = 0.008333333333333333 * v75;
    a[2] = v76;
    a[6] = v33;
    a[10] = 1.0;
    double v80 = p[0] * p[1];
    double v81 = 0.025 * v80;
    double v82 = v39 * v81;
    double v83 = p[1] * v82;
    double v84 = v41 * v81;
    double v85 = p[1] * v84;
    double v86 = v83 + v85;
    double v87 = -v86;
    double v88 = 2.0 * v87;
    double v89 = 0.05 * v80;
    double v90 = v46 * v89;
    double v91 = p[1] * v90;
    double v92 = v88 - v91;
    double v93 = 0.008333333333333333 * v92;
    a[3] = v93;
    double v95 = v13 * v81;
    double v96 = p[1] * v95;
    double v97 = v22 * v81;
    double v98 = p[1] * v97;
    double v99 = v96 + v98;
    double v100 = 2.0 * v99;
    double v101 = v30 * v89;
    double v102 = p[1] * v101;
    double v103 = v100 + v102;
    double v104 = 0.008333333333333333 * v103;
    a[7] = v104;
    double v106 = 4.0 * v80;
    double v107 = v80 + v106;
    double v108 = v107 + v80;
    double v109 = 0.008333333333333333 * v108;
    a[11] = v109;
    a[15] = 1.0;
    double v112 = 0.025 * p[1];
    double v113 = p[0] * v112;
    double v114 = 0.025 * v113;
    double v115 = v41 * v114;
    double v116 = p[1] * v115;
    double v117 = -v116;
    double v118 = 2.0 * v117;
    double v119 = 0.05 * v113;
    double v120 = v46 * v119;
    double v121 = p[1] * v120;
    double v122 = v118 - v121;
    double v123 = 0.008333333333333333 * v122;
    b[0] = v123;
    double v125 = v22 * v114;
    double v126 = p[1] * v125;
    double v127 = 2.0 * v126;
    double v128 = v30 * v119;
    double v129 = p[1] * v128;
    double v130 = v127 + v129;
    double v131 = 0.008333333333333333 * v130;
    b[1] = v131;
    double v133 = 4.0 * v113;
    double v134 = 0.05 * p[1];
    double v135 = p[0] * v134;
    double v136 = v133 + v135;
    double v137 = 0.008333333333333333 * v136;
    b[2] = v137;
    b[3] = 0.05;
    over[2] = v75;
    over[6] = v32;
    over[3] = v92;
    over[7] = v103;
    over[11] = v108;
}

static void lateral_mpc_stage(const double *zu, const double *p, double *r, double *c, double *over, double *under)
{
    double v2 = p[14] + p[15];
    double v3 = p[14] * p[15];
    double v4 = v2 - v3;
    double v5 = v4 * p[14];
    double v6 = p[14] + p[15];
    double v8 = v6 + 0.0001;
    double v9 = v5 / v8;
    double v11 = zu[0] * zu[0];
    double v12 = zu[0] * v11;
    double v14 = v12 * p[2];
    double v15 = zu[0] * zu[0];
    double v17 = v15 * p[3];
    double v18 = v14 + v17;
    double v20 = zu[0] * p[4];
    double v21 = v18 + v20;
    double v23 = v21 + p[5];
    double v26 = p[16] / 2.0;
    double v27 = v23 - v26;
    double v28 = v9 * v27;
    double v29 = v4 * p[15];
    double v30 = p[14] + p[15];
    double v31 = v30 + 0.0001;
    double v32 = v29 / v31;
    double v34 = v12 * p[6];
    double v36 = v15 * p[7];
    double v37 = v34 + v36;
    double v39 = zu[0] * p[8];
    double v40 = v37 + v39;
    double v42 = v40 + p[9];
    double v43 = p[16] / 2.0;
    double v44 = v42 + v43;
    double v45 = v32 * v44;
    double v46 = v28 + v45;
    double v48 = 1.0 - v4;
    double v50 = v12 * p[10];
    double v52 = v15 * p[11];
    double v53 = v50 + v52;
    double v55 = zu[0] * p[12];
    double v56 = v53 + v55;
    double v58 = v56 + p[13];
    double v59 = v48 * v58;
    double v60 = v46 + v59;
    double v62 = v60 - zu[1];
    r[0] = v62;
    double v64 = zu[1] - v23;
    double v65 = exp(v64);
    double v66 = p[14] * v65;
    r[1] = v66;
    double v68 = v42 - zu[1];
    double v69 = exp(v68);
    double v70 = p[15] * v69;
    r[2] = v70;
    double v73 = p[1] + 1.0;
    double v75 = zu[0] * zu[0];
    double v76 = 3.0 * v75;
    double v77 = v76 * p[2];
    double v78 = 2.0 * zu[0];
    double v79 = v78 * p[3];
    double v80 = v77 + v79;
    double v81 = v80 + p[4];
    double v82 = atan(v81);
    double v83 = v9 * v82;
    double v84 = v76 * p[6];
    double v85 = v78 * p[7];
    double v86 = v84 + v85;
    double v87 = v86 + p[8];
    double v88 = atan(v87);
    double v89 = v32 * v88;
    double v90 = v83 + v89;
    double v91 = v76 * p[10];
    double v92 = v78 * p[11];
    double v93 = v91 + v92;
    double v94 = v93 + p[12];
    double v95 = atan(v94);
    double v96 = v48 * v95;
    double v97 = v90 + v96;
    double v99 = v97 - zu[2];
    double v100 = v73 * v99;
    r[3] = v100;
    double v102 = p[1] + 1.0;
    double v104 = v102 * zu[4];
    r[4] = v104;
    double v106 = 2.0 * zu[0];
    double v107 = zu[0] * v106;
    double v108 = v11 + v107;
    double v109 = p[2] * v108;
    double v110 = 2.0 * zu[0];
    double v111 = p[3] * v110;
    double v112 = v109 + v111;
    double v113 = v112 + p[4];
    double v114 = v9 * v113;
    double v115 = p[6] * v108;
    double v116 = p[7] * v110;
    double v117 = v115 + v116;
    double v118 = v117 + p[8];
    double v119 = v32 * v118;
    double v120 = v114 + v119;
    double v121 = p[10] * v108;
    double v122 = p[11] * v110;
    double v123 = v121 + v122;
    double v124 = v123 + p[12];
    double v125 = v48 * v124;
    double v126 = v120 + v125;
    c[0] = v126;
    double v128 = v65 * v113;
    double v129 = p[14] * v128;
    double v130 = -v129;
    c[5] = v130;
    double v132 = v69 * v118;
    double v133 = p[15] * v132;
    c[10] = v133;
    double v136 = 6.0 * zu[0];
    double v137 = p[2] * v136;
    double v138 = 2.0 * p[3];
    double v139 = v137 + v138;
    double v140 = v81 * v81;
    double v141 = 1.0 + v140;
    double v142 = v139 / v141;
    double v143 = v9 * v142;
    double v144 = p[6] * v136;
    double v145 = 2.0 * p[7];
    double v146 = v144 + v145;
    double v147 = v87 * v87;
    double v148 = 1.0 + v147;
    double v149 = v146 / v148;
    double v150 = v32 * v149;
    double v151 = v143 + v150;
    double v152 = p[10] * v136;
    double v153 = 2.0 * p[11];
    double v154 = v152 + v153;
    double v155 = v94 * v94;
    double v156 = 1.0 + v155;
    double v157 = v154 / v156;
    double v158 = v48 * v157;
    double v159 = v151 + v158;
    double v160 = v73 * v159;
    c[15] = v160;
    c[1] = (-1.0);
    double v164 = p[14] * v65;
    c[6] = v164;
    double v166 = p[15] * v69;
    double v167 = -v166;
    c[11] = v167;
    double v169 = -v73;
    c[17] = v169;
    c[24] = v102;
}

static void lateral_mpc_end(const double *zu, const double *p, double *r, double *c, double *over, double *under)
{
    double v2 = p[14] + p[15];
    double v3 = p[14] * p[15];
    double v4 = v2 - v3;
    double v5 = v4 * p[14];
    double v6 = p[14] + p[15];
    double v8 = v6 + 0.0001;
    double v9 = v5 / v8;
    double v11 = zu[0] * zu[0];
    double v12 = zu[0] * v11;
    double v14 = v12 * p[2];
    double v15 = zu[0] * zu[0];
    double v17 = v15 * p[3];
    double v18 = v14 + v17;
    double v20 = zu[0] * p[4];
    double v21 = v18 + v20;
    double v23 = v21 + p[5];
    double v26 = p[16] / 2.0;
    double v27 = v23 - v26;
    double v28 = v9 * v27;
    double v29 = v4 * p[15];
    double v30 = p[14] + p[15];
    double v31 = v30 + 0.0001;
    double v32 = v29 / v31;
    double v34 = v12 * p[6];
    double v36 = v15 * p[7];
    double v37 = v34 + v36;
    double v39 = zu[0] * p[8];
    double v40 = v37 + v39;
    double v42 = v40 + p[9];
    double v43 = p[16] / 2.0;
    double v44 = v42 + v43;
    double v45 = v32 * v44;
    double v46 = v28 + v45;
    double v48 = 1.0 - v4;
    double v50 = v12 * p[10];
    double v52 = v15 * p[11];
    double v53 = v50 + v52;
    double v55 = zu[0] * p[12];
    double v56 = v53 + v55;
    double v58 = v56 + p[13];
    double v59 = v48 * v58;
    double v60 = v46 + v59;
    double v62 = v60 - zu[1];
    r[0] = v62;
    double v64 = zu[1] - v23;
    double v65 = exp(v64);
    double v66 = p[14] * v65;
    r[1] = v66;
    double v68 = v42 - zu[1];
    double v69 = exp(v68);
    double v70 = p[15] * v69;
    r[2] = v70;
    double v73 = 2.0 * p[1];
    double v74 = v73 + 1.0;
    double v76 = zu[0] * zu[0];
    double v77 = 3.0 * v76;
    double v78 = v77 * p[2];
    double v79 = 2.0 * zu[0];
    double v80 = v79 * p[3];
    double v81 = v78 + v80;
    double v82 = v81 + p[4];
    double v83 = atan(v82);
    double v84 = v9 * v83;
    double v85 = v77 * p[6];
    double v86 = v79 * p[7];
    double v87 = v85 + v86;
    double v88 = v87 + p[8];
    double v89 = atan(v88);
    double v90 = v32 * v89;
    double v91 = v84 + v90;
    double v92 = v77 * p[10];
    double v93 = v79 * p[11];
    double v94 = v92 + v93;
    double v95 = v94 + p[12];
    double v96 = atan(v95);
    double v97 = v48 * v96;
    double v98 = v91 + v97;
    double v100 = v98 - zu[2];
    double v101 = v74 * v100;
    r[3] = v101;
    double v103 = 2.0 * zu[0];
    double v104 = zu[0] * v103;
    double v105 = v11 + v104;
    double v106 = p[2] * v105;
    double v107 = 2.0 * zu[0];
    double v108 = p[3] * v107;
    double v109 = v106 + v108;
    double v110 = v109 + p[4];
    double v111 = v9 * v110;
    double v112 = p[6] * v105;
    double v113 = p[7] * v107;
    double v114 = v112 + v113;
    double v115 = v114 + p[8];
    double v116 = v32 * v115;
    double v117 = v111 + v116;
    double v118 = p[10] * v105;
    double v119 = p[11] * v107;
    double v120 = v118 + v119;
    double v121 = v120 + p[12];
    double v122 = v48 * v121;
    double v123 = v117 + v122;
    c[0] = v123;
    double v125 = v65 * v110;
    double v126 = p[14] * v125;
    double v127 = -v126;
    c[5] = v127;
    double v129 = v69 * v115;
    double v130 = p[15] * v129;
    c[10] = v130;
    double v133 = 6.0 * zu[0];
    double v134 = p[2] * v133;
    double v135 = 2.0 * p[3];
    double v136 = v134 + v135;
    double v137 = v82 * v82;
    double v138 = 1.0 + v137;
    double v139 = v136 / v138;
    double v140 = v9 * v139;
    double v141 = p[6] * v133;
    double v142 = 2.0 * p[7];
    double v143 = v141 + v142;
    double v144 = v88 * v88;
    double v145 = 1.0 + v144;
    double v146 = v143 / v145;
    double v147 = v32 * v146;
    double v148 = v140 + v147;
    double v149 = p[10] * v133;
    double v150 = 2.0 * p[11];
    double v151 = v149 + v150;
    double v152 = v95 * v95;
    double v153 = 1.0 + v152;
    double v154 = v151 / v153;
    double v155 = v48 * v154;
    double v156 = v148 + v155;
    double v157 = v74 * v156;
    c[15] = v157;
    c[1] = (-1.0);
    double v161 = p[14] * v65;
    c[6] = v161;
    double v163 = p[15] * v69;
    double v164 = -v163;
    c[11] = v164;
    double v166 = -v74;
    c[17] = v166;
}
/* end: written by mpc_parts.py */

typedef struct {
    int nx, residuals, end_residuals, bounded, linear, shift;
    int state[2]; /* indices of bounded states */
    double low[2], high[2], control_bound;
    double sixth; /* of the RK4 step, s */
    void (*rk4)(const double *, const double *, const double *, double *, double *, double *, double *);
    void (*stage)(const double *, const double *, double *, double *, double *, double *);
    void (*end)(const double *, const double *, double *, double *, double *, double *);
} Model;

typedef struct {
    double h[N][N], gradient[N], states[N + 1][STATES], derivative[N + 1][STATES][N];
} Condensed;

typedef double Matrix[STATES][STATES + 1];

#define INLINE static inline __attribute__((always_inline))
#define UNROLL _Pragma("GCC unroll 8") /* so that the compiler can omit absent terms */

INLINE double larger(double a, double b) /* b can be NaN */
{
    return b > a ? b : a;
}

/* The rows of column `j` of a step's Jacobian (with respect to state and control) that are not always 0 start at
   `first` and end before `behind`. The others are left out, because 0 times infinity is NaN. The longitudinal
   problem's states 3 to 5 are the lead's and do not depend on the host's. */
INLINE int first(const Model model, int j)
{
    return model.linear && j >= 3 && j < 6 ? 3 : 0;
}

INLINE int behind(const Model model, int j)
{
    return j < model.nx ? j + 1 : model.linear ? 3 : model.nx;
}

INLINE int width(const Model model, int i) /* end of the state columns in row `i` */
{
    return model.linear && i < 3 ? 3 : model.nx;
}

/* RK4 steps: the next state, and its Jacobian with respect to state and control; `over` has the factors of `sixth` in
   the last step's Jacobian with respect to the state.

   CasADi multiplies constants first: c * (sixth * x) becomes (c * sixth) * x. */
INLINE void integrate(
    const Model model, int steps, const double *zu, const double *p, double *end, Matrix m, double *over)
{
    const int nx = model.nx;
    memcpy(end, zu, nx * sizeof *end);
    for (int i = 0; i < nx; i++)
        for (int j = 0; j <= nx; j++)
            m[i][j] = i == j;
    for (int step = 0; step < steps; step++) {
        double next[STATES], a[STATES * STATES] = {0}, b[STATES] = {0};
        Matrix was;
        memcpy(was, m, sizeof was);
        model.rk4(end, zu + nx, p, next, a, b, over);
        UNROLL
        for (int i = 0; i < nx; i++) {
            UNROLL
            for (int j = 0; j <= nx; j++) {
                double sum = 0.0;
                UNROLL
                for (int r = i; r < width(model, i); r++)
                    if (model.linear && step == 1 && i == 3 && r == 4 && j == 5)
                        sum += a[i * nx + r] * model.sixth * over[r * nx + j];
                    else if (!model.linear && i < 3 && r == 3 && j == 4)
                        sum += was[r][j] * model.sixth * over[i * nx + r];
                    else
                        sum += a[i * nx + r] * was[r][j];
                m[i][j] = sum;
            }
            m[i][nx] += b[i];
            end[i] = next[i];
        }
    }
}

/* Residuals of a node, and their Jacobian with respect to its state and control. For elements 0.1 * x of the
   Jacobian, `over` has x; for elements 1 / x and -1 / x, `under` has x and -x. */
typedef struct {
    double r[RESIDUALS], c[RESIDUALS * (STATES + 1)], over[RESIDUALS * (STATES + 1)], under[RESIDUALS * (STATES + 1)];
} Cost;

/* A number times an element of the Jacobian: CasADi calculates y / x for y * (1 / x). */
INLINE double by(const Model model, const Cost *cost, int k, int i, double y)
{
    const int place = k * (model.nx + 1) + i, quotient = model.linear && k == 1 && (i == 0 || i == 3);
    return quotient ? y / cost->under[place] : y * cost->c[place];
}

/* A weight times an element of the Jacobian: CasADi multiplies constants first. */
INLINE double weighed(const Model model, const Cost *cost, int k, int i, double weight)
{
    const int product = model.linear && k >= 2 && i == 1;
    return product ? weight * 0.1 * cost->over[k * (model.nx + 1) + i] : by(model, cost, k, i, weight);
}

/* Hessian (for a stage, its upper half) and gradient of a cost with respect to state and control; the gradient is the
   one after a change of the state. Only a stage's last residual depends on the control; the others are left out,
   because 0 * NaN is NaN. */
INLINE void gauss_newton(
    const Model model, int stage, const Cost *cost, const double *weights, const double *change,
    double hess[STATES + 1][STATES + 1], double *slope)
{
    const int nx = model.nx, count = stage ? model.residuals : model.end_residuals;
    double cw[STATES + 1][RESIDUALS], moved[RESIDUALS];
    UNROLL
    for (int k = 0; k < count; k++) {
        double sum = 0.0;
        UNROLL
        for (int j = 0; j < nx; j++)
            sum += by(model, cost, k, j, change[j]);
        moved[k] = cost->r[k] + sum;
        UNROLL
        for (int i = 0; i <= nx; i++)
            cw[i][k] = weighed(model, cost, k, i, weights[k]);
    }
    UNROLL
    for (int i = 0; i <= nx; i++) {
        UNROLL
        for (int j = stage ? i : 0; j <= nx; j++) {
            double sum = 0.0;
            UNROLL
            for (int k = i == nx || j == nx ? count - 1 : 0; k < count; k++)
                sum += by(model, cost, k, j, cw[i][k]);
            hess[i][j] = sum;
        }
        slope[i] = 0.0;
        UNROLL
        for (int k = i == nx ? count - 1 : 0; k < count; k++)
            slope[i] += cw[i][k] * moved[k];
    }
}

/* `condense`: the quadratic program in the change of the controls. */
INLINE void condense(
    const Model model, const double *weights, const double *old, const double *z0, const double *p, Condensed *to)
{
    const int nx = model.nx;
    const double *controls = old + nx * (N + 1);
    double zu[N + 1][STATES + 1], change[N + 1][STATES];
    double over[STATES * STATES];
    Matrix m[N], fixed[2];

    for (int k = 0; k <= N; k++) {
        memcpy(zu[k], old + nx * k, nx * sizeof(double));
        zu[k][nx] = k < N ? controls[k] : 0.0;
    }
    if (model.linear) {
        double unused[STATES];
        integrate(model, 1, zu[0], p, unused, fixed[0], over);
        integrate(model, 3, zu[0], p, unused, fixed[1], over);
    }
    for (int i = 0; i < nx; i++) {
        to->states[0][i] = z0[i];
        change[0][i] = z0[i] - zu[0][i];
    }
    for (int k = 0; k < N; k++) {
        double following[STATES];
        if (model.linear) {
            memcpy(m[k], fixed[k >= SHORT_INTERVALS], sizeof m[k]);
            for (int i = 0; i < nx; i++) {
                following[i] = 0.0;
                for (int j = 0; j <= nx; j++)
                    following[i] += m[k][i][j] * zu[k][j];
            }
        } else {
            integrate(model, k < SHORT_INTERVALS ? 1 : 3, zu[k], p, following, m[k], over);
        }
        for (int i = 0; i < nx; i++) {
            double sum = 0.0, by[N] = {0};
            for (int r = i; r < width(model, i); r++) {
                const int constant = !model.linear && k < SHORT_INTERVALS && i < 3 && r == 3; /* the derivative */
                sum += m[k][i][r] * change[k][r];
                for (int j = 0; j < k && i < behind(model, nx); j++)
                    by[j] += constant ? to->derivative[k][r][j] * model.sixth * over[i * nx + r]
                                      : m[k][i][r] * to->derivative[k][r][j];
            }
            to->states[k + 1][i] = following[i] + sum; /* CasADi calculates z + (x - z) for x */
            change[k + 1][i] = to->states[k + 1][i] - zu[k + 1][i];
            by[k] = m[k][i][nx];
            memcpy(to->derivative[k + 1][i], by, sizeof by);
        }
    }

    double hess[STATES + 1][STATES + 1], grad[STATES + 1];
    Cost cost = {0};
    model.end(zu[N], p, cost.r, cost.c, cost.over, cost.under);
    gauss_newton(model, 0, &cost, weights, change[N], hess, grad);
    for (int k = N - 1; k >= 0; k--) {
        double block[STATES + 1][STATES + 1], slope[STATES + 1], hm[STATES][STATES + 1], scaled[RESIDUALS];
        for (int i = 0; i < model.residuals; i++)
            scaled[i] = (k < SHORT_INTERVALS ? 1.0 : 3.0) * weights[i];
        memset(&cost, 0, sizeof cost);
        model.stage(zu[k], p, cost.r, cost.c, cost.over, cost.under);
        gauss_newton(model, 1, &cost, scaled, change[k], block, slope);
        UNROLL
        for (int i = 0; i < nx; i++)
            UNROLL
            for (int j = 0; j <= nx; j++) {
                hm[i][j] = 0.0;
                UNROLL
                for (int l = first(model, j); l < behind(model, j); l++)
                    hm[i][j] += hess[i][l] * m[k][l][j];
            }
        UNROLL
        for (int i = 0; i <= nx; i++) {
            double sum = 0.0;
            UNROLL
            for (int j = i; j <= nx; j++) {
                double product = 0.0;
                UNROLL
                for (int l = first(model, i); l < behind(model, i); l++)
                    product += m[k][l][i] * hm[l][j];
                block[i][j] += product;
            }
            UNROLL
            for (int l = first(model, i); l < behind(model, i); l++)
                sum += m[k][l][i] * grad[l];
            slope[i] += sum;
        }
        UNROLL
        for (int i = 0; i < nx; i++) {
            UNROLL
            for (int j = 0; j < nx; j++)
                hess[i][j] = i <= j ? block[i][j] : block[j][i];
            grad[i] = slope[i];
        }
        for (int j = 0; j < k; j++) {
            double sum = 0.0;
            for (int i = 0; i < behind(model, nx); i++)
                sum += to->derivative[k][i][j] * block[i][nx];
            to->h[j][k] = to->h[k][j] = sum;
        }
        to->h[k][k] = block[nx][nx];
        to->gradient[k] = slope[nx];
    }
}

/* `_solve_program`: the minimiser and 1, or zeros and 0 if there is none. */
INLINE double solve(const Model model, Quadprog *quadprog, Condensed *of, const double *u, double *x)
{
    const int rows = N * model.bounded;
    double a[ROWS][N], lower[N + ROWS], upper[N + ROWS], lam[N + ROWS] = {0};
    int sense[N + ROWS];
    for (int j = 0; j < N; j++) {
        x[j] = 0.0;
        lower[j] = -model.control_bound - u[j];
        upper[j] = model.control_bound - u[j];
    }
    for (int row = 0; row < rows; row++) {
        const int k = 1 + row / model.bounded, which = row % model.bounded, i = model.state[which];
        memcpy(a[row], of->derivative[k][i], sizeof a[row]);
        memset(a[row] + k, 0, (N - k) * sizeof(double));
        lower[N + row] = model.low[which] - of->states[k][i];
        upper[N + row] = model.high[which] - of->states[k][i];
    }
    for (int j = 0; j < N + rows; j++)
        sense[j] = lower[j] == upper[j] ? 5 : 0; /* DAQP's ACTIVE and IMMUTABLE */
    Problem problem = {N, N + rows, N, of->h[0], of->gradient, a[0], upper, lower, sense, {0}};
    Result result = {.x = x, .lam = lam};
    quadprog(&result, &problem, NULL);

    double slope = 0.0, largest = 0.0, excess = -INFINITY, square = 0.0;
    for (int i = 0; i < N; i++) {
        double by_h = 0.0, by_rows = 0.0;
        for (int j = 0; j < N; j++)
            by_h += of->h[j][i] * x[j];
        for (int row = 0; row < rows; row++)
            by_rows += a[row][i] * lam[N + row];
        slope = larger(slope, fabs(by_h + of->gradient[i] + by_rows + lam[i]));
        largest = larger(largest, fabs(of->gradient[i]));
        excess = larger(larger(excess, lower[i] - x[i]), x[i] - upper[i]);
        square += x[i] * x[i];
    }
    for (int row = 0; row < rows; row++) {
        double at = 0.0;
        for (int j = 0; j < N; j++)
            at += a[row][j] * x[j];
        excess = larger(larger(excess, lower[N + row] - at), at - upper[N + row]);
    }
    const int solved = slope <= STATIONARITY_TOL * (1.0 + largest) && excess <= FEASIBILITY_TOL && square < LARGEST;
    if (!solved)
        memset(x, 0, N * sizeof *x);
    return solved;
}

/* `build_solver`: `call` has the addresses of DAQP's function, weights, arguments and results. */
INLINE void iterate(const Model model, void **call)
{
    const int nx = model.nx, end = nx * (N + 1);
    const double *old = call[2], *p = call[4];
    double *new = call[5], *next = call[6], *flags = call[7], x[N], square = 0.0, sum = 0.0;
    Condensed of;
    condense(model, call[1], old, call[3], p, &of);
    flags[0] = solve(model, (Quadprog *)call[0], &of, old + end, x);
    for (int k = 0; k <= N; k++)
        for (int i = 0; i < nx; i++) {
            double moved = 0.0;
            for (int j = 0; j < k; j++)
                moved += of.derivative[k][i][j] * x[j];
            new[nx * k + i] = of.states[k][i] + moved;
        }
    for (int j = 0; j < N; j++)
        new[end + j] = old[end + j] + x[j];
    memcpy(next, new, (end + N) * sizeof *next);
    if (model.shift) {
        double last[STATES + 1], over[STATES * STATES];
        Matrix unused;
        memcpy(next, new + nx, (end - nx) * sizeof *next);
        memcpy(last, new + end - nx, nx * sizeof *last);
        last[nx] = new[end + N - 1];
        integrate(model, 3, last, p, next + end - nx, unused, over);
        memcpy(next + end, new + end + 1, (N - 1) * sizeof *next);
    }
    for (int j = 0; j < end + N; j++)
        square += new[j] * new[j];
    for (int j = 0; j < N; j++)
        sum += fabs(of.gradient[j]);
    flags[1] = square < LARGEST && sum < LARGEST_GRADIENT;
}

/* Whether DAQP is compatible: minimise x^2 + y^2 - 2 x - 6 y with y <= 2 and x + y <= 10. */
int agrees(Quadprog *quadprog)
{
    double h[4] = {2.0, 0.0, 0.0, 2.0}, f[2] = {-2.0, -6.0}, a[2] = {1.0, 1.0}, x[2] = {0}, lam[3] = {0};
    double lower[3] = {-5.0, -INFINITY, -10.0}, upper[3] = {5.0, 2.0, 10.0};
    int sense[3] = {0};
    Problem problem = {2, 3, 2, h, f, a, upper, lower, sense, {0}};
    Result result = {.x = x, .lam = lam};
    quadprog(&result, &problem, NULL);
    return fabs(x[0] - 1.0) + fabs(x[1] - 2.0) + fabs(lam[0]) + fabs(lam[1] - 2.0) + fabs(lam[2]) < 1e-9;
}

void long_iteration(void **call)
{
    const Model model = {
        .nx = 6, .residuals = 4, .end_residuals = 3, .linear = 1, .sixth = 0.2 / 6, .control_bound = INFINITY,
        .bounded = 1, .state = {1}, .low = {-0.0}, .high = {INFINITY},
        .rk4 = long_mpc_rk4, .stage = long_mpc_stage, .end = long_mpc_end,
    };
    iterate(model, call);
}

void lateral_iteration(void **call)
{
    const double heading = 1.5707963267948966, delta = 0.4363323129985824; /* 90 and 25 degrees */
    const Model model = {
        .nx = 4, .residuals = 5, .end_residuals = 4, .shift = 1, .sixth = 0.05 / 6, .control_bound = 0.1,
        .bounded = 2, .state = {2, 3}, .low = {-heading, -delta}, .high = {heading, delta},
        .rk4 = lateral_mpc_rk4, .stage = lateral_mpc_stage, .end = lateral_mpc_end,
    };
    iterate(model, call);
}
