/* The coefficients of cubic_fit.py, each summed in the order of the points.

   Stands for: cubic_fit.py, ../../common/ordered.py.
*/

void fit(const double *weights, const double *points, long n, double *coefficients)
{
    for (int i = 0; i < 4; i++) {
        double sum = 0.0;
        for (long k = 0; k < n; k++)
            sum += weights[i * n + k] * points[k];
        coefficients[i] = sum;
    }
}
